//! The pegfit command line as a library: scene files, the commands, and the pictures they draw.
//!
//! The binary only parses arguments and turns a [`CommandError`] into text and an exit code.

pub mod args;
pub mod commands;
mod context;
mod error;
mod exit;
mod memory;
mod report;
pub mod scene;
pub mod terminal;

pub use error::{CommandError, SceneFileError};
pub use exit::Exit;
pub use report::{picture, poses};
