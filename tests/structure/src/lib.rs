//! Which file of a crate takes what from which other file, read from the source itself.
//!
//! An arrow goes from the file that names an item to the file that *defines* it: re-exports are
//! followed, so that a `mod.rs` which only declares and re-exports its children is no part of any
//! circle. Unit tests are left out.

mod graph;
mod lengths;
mod picture;
mod resolve;
mod source;
mod surface;

pub use graph::{Graph, circles};
pub use lengths::file_length;
pub use picture::flow_chart;
pub use resolve::arrows;
pub use source::{Module, SourceError, read_crate};
pub use surface::{Item, public_paths};
