//! The pegfit command line as a library: [`program::run`], and the reports that Python writes, too.

#[macro_use]
pub mod terminal;

mod args;
mod bytes;
mod commands;
mod context;
mod error;
mod memory;
pub mod program;
mod report;

pub use error::Exit;

pub use memory::budget as memory_budget;
pub use report::assembly::AssemblyReport;
pub use report::path::PathReport;
pub use report::session::SessionReport;
