//! What is written of a way: rows, a summary, charts, a page that plays it.

mod charts;
pub(crate) mod page;
pub(crate) mod rows;
mod subject;
pub(crate) mod summary;

pub use subject::WayReport;
