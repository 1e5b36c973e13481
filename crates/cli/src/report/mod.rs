//! What commands write: pages, tables of poses, logs.

pub(crate) mod felt;
pub(crate) mod html;
pub(crate) mod ledger;
pub(crate) mod output;
pub(crate) mod parquet_log;
pub(crate) mod way;
