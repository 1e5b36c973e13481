//! The pegfit command line as a library: scene files, the commands, and the pictures they draw.
//!
//! The binary only parses arguments and turns a [`CommandError`] into text and an exit code.

pub mod args;
pub mod assembly;
pub mod command;
pub mod device_choice;
pub mod error;
pub mod exit;
pub mod figure;
pub mod hold;
pub mod memory;
mod parquet_log;
pub mod picture;
pub mod poses;
pub mod progress;
mod say;
pub mod scene;
pub mod slice;
mod svg;
pub mod vti;

pub use error::CommandError;
pub use exit::Exit;
pub use scene::Scene;
