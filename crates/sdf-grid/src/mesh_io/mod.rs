//! Reading and writing mesh files.
//!
//! Files are untrusted: nothing is allocated from a count that the file states before the bytes
//! that back it have been seen, and every mesh goes through
//! [`TriangleMesh::clean`](crate::TriangleMesh::clean). A file is read into a [`MeshFile`], which
//! lists the solids in it; cleaning turns all of them, or one, into a
//! [`TriangleMesh`](crate::TriangleMesh). `docs/input.md` says what is read of each format.

mod content;
mod converter;
mod file;
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

pub use content::MeshFormat;
pub use converter::Converter;
pub use file::{Examination, FORMATS, MeshFile, ReadOptions, examine, read, read_with};
pub use obj::{write_obj, write_obj_in};
pub use soup::Solid;
pub use step::StepOptions;
