//! The score by direct quadrature: any rotation, no table, a few megabytes.

pub(crate) mod condition;
pub(crate) mod evaluator;
mod lookup;
mod quadrature;
pub(crate) mod terms;
pub(crate) mod tiles;

pub use evaluator::{DirectDescription, FullResponse, TermDescription};
