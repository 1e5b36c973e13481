//! Between the command and whoever typed it: progress, interrupts, lines of text.

pub mod hold;
pub mod progress;
mod say;
pub mod shown;
