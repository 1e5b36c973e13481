//! The page of a run of the haptic loop, and its words.

mod charts;
mod page;
mod subject;
mod words;

pub use subject::FeltPage;
pub(crate) use words::{privileges, told};
