//! What commands write: pictures, pages, tables of poses, fields and logs.

pub(crate) mod bytes;
pub(crate) mod figure;
pub(crate) mod html;
pub(crate) mod output;
pub(crate) mod parquet_log;
pub mod picture;
pub mod poses;
pub(crate) mod slice;
pub(crate) mod vti;
