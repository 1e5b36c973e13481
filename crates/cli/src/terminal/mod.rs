//! The terminal: progress, interrupts, lines of text.

pub(crate) mod error_text;
#[macro_use]
pub(crate) mod output;
pub mod progress;
