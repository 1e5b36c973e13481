//! Between the command and whoever typed it: progress, interrupts, lines of text.

pub mod error_text;
pub mod output;
pub mod progress;
