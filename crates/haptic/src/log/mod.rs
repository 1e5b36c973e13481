//! Logs: what every tick left, written while the loop runs, read back, and replayed.

pub(crate) mod columns;
pub(crate) mod csv;
pub(crate) mod error;
#[cfg(feature = "parquet")]
mod parquet_log;
pub(crate) mod read;
pub(crate) mod record;
mod recorded_device;
pub(crate) mod replay;
pub(crate) mod writer;

pub use columns::{COLUMNS, faults, numbers};
pub use csv::write_csv;
#[cfg(feature = "parquet")]
pub use parquet_log::create_parquet;
pub use recorded_device::{device_file, read_device, write_device};
pub use writer::SampleWriter;
