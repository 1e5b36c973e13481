//! Tables on disk or in an object store: a Zarr v3 group, one chunk of energies per rotation node.
//!
//! `docs/table-format.md` describes the files. A table appears whole (its metadata is prepared
//! beside it and renamed into place, or in an object store written last), and so does every chunk;
//! a chunk that is there and was baked for its place in this table is finished.

mod array;
#[cfg(feature = "cloud")]
mod cloud;
pub(crate) mod error;
pub(crate) mod files;
pub(crate) mod metadata;
mod storage;
pub(crate) mod table_store;
