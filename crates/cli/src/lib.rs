//! The pegfit command line as a library: arguments and the commands.
//!
//! The binary only calls [`program::run`].

pub mod args;
pub mod commands;
mod context;
mod error;
mod memory;
pub mod program;
mod report;
pub mod terminal;

pub use error::{CommandError, Exit, SceneFileError};

pub use memory::budget as memory_budget;
pub use report::path::PathReport;
pub use report::session::SessionReport;
