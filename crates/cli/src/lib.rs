//! The pegfit command line as a library: arguments and the commands.
//!
//! The binary only calls [`program::run`].

pub mod args;
mod bytes;
pub mod commands;
mod context;
mod error;
mod exit;
mod memory;
pub mod program;
mod report;
pub mod terminal;

pub use error::{CommandError, SceneFileError};
pub use exit::Exit;
pub use memory::budget as memory_budget;
pub use report::felt::FeltPage;
pub use report::way::WayReport;
