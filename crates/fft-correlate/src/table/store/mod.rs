//! Tables on disk or in an object store: a Zarr v3 group, one chunk of energies per rotation node.
//!
//! `docs/table-format.md` describes the files. A table appears whole (its metadata is prepared
//! beside it and renamed into place, or in an object store written last), and so does every chunk;
//! a chunk that is there and was baked for its place in this table is finished.

mod array;
mod backend;
pub(crate) mod chunks;
#[cfg(feature = "cloud")]
mod cloud;
mod coding;
mod coordinates;
pub(crate) mod error;
pub(crate) mod files;
pub(crate) mod format;
mod header;
mod load;
mod part_size;
mod seal;
mod skeleton;
mod surfaces;
pub(crate) mod table_store;
