//! Reading and writing mesh files.
//!
//! Files are untrusted: nothing is allocated from a count that the file states before the bytes
//! that back it have been seen, and every mesh goes through
//! [`TriangleMesh::clean`](crate::TriangleMesh::clean). A file is read into a [`MeshFile`], which
//! lists the solids in it; cleaning turns all of them, or one, into a
//! [`TriangleMesh`](crate::TriangleMesh). `docs/input.md` says what is read of each format.

mod bytes;
mod content;
mod converter;
mod examination;
mod file;
mod format;
mod gltf;
pub(crate) mod ledger;
mod obj;
mod parts;
mod ply;
mod soup;
mod step;
mod stl;
mod threemf;
pub(crate) mod unit;
mod write;

pub use converter::Converter;
pub use examination::{Examination, examine};
pub use file::{FORMATS, MeshFile, ReadOptions, read, read_with};
pub use format::MeshFormat;
pub use soup::Solid;
pub use step::StepOptions;
pub use write::{write_obj, write_obj_in};
