//! The pegfit command line as a library: [`program::run`], and the reports that Python writes, too.

mod args;
mod commands;
mod context;
mod error;
mod memory;
pub mod program;
mod report;
pub mod terminal;

pub use error::Exit;

pub use memory::budget as memory_budget;
pub use report::path::PathReport;
pub use report::session::SessionReport;
pub(crate) use terminal::output::{remark, say};
