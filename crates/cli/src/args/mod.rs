//! The command line: what may be typed, and what it means.

mod command_line;
pub mod device_choice;
mod ways;

pub use command_line::*;
pub use ways::*;
