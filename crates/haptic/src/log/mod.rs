//! Logs: what every tick left, written while the loop runs, read back, and replayed.

mod check;
pub(crate) mod columns;
pub(crate) mod csv;
pub(crate) mod error;
#[cfg(feature = "parquet")]
mod parquet_log;
pub(crate) mod read;
pub(crate) mod record;
mod recorded_device;
pub(crate) mod replay;
mod size_limit;
pub(crate) mod writer;

pub use check::ReplayError;
pub use columns::{COLUMNS, faults, numbers};
pub use csv::{create_csv, write_csv};
#[cfg(feature = "parquet")]
pub use parquet_log::create_parquet;
pub use read::Recording;
pub use recorded_device::{device_file, read_device, write_device};
pub use writer::SampleWriter;
