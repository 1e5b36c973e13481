//! What commands write: pages, tables of poses, logs.

pub(crate) mod assembly;
pub(crate) mod output;
pub(crate) mod page;
pub(crate) mod parquet_log;
pub(crate) mod path;
pub(crate) mod player;
pub(crate) mod screen;
pub(crate) mod session;
pub(crate) mod table_file;
