//! Between the command and whoever typed it: progress, interrupts, lines of text.

pub(crate) mod error_text;
#[macro_use]
pub(crate) mod output;
pub mod progress;
