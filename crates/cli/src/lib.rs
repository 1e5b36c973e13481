//! The pegfit command line as a library: arguments and the commands.
//!
//! The binary only parses arguments and turns a [`CommandError`] into text and an exit code.

pub mod args;
mod bytes;
pub mod commands;
mod context;
mod error;
mod exit;
mod memory;
mod report;
pub mod terminal;

pub use error::{CommandError, SceneFileError};
pub use exit::Exit;
