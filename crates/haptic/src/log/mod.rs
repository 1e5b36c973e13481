//! Logs: what every tick left, written while the loop runs, read back, and replayed.

pub(crate) mod csv;
mod device_record;
pub(crate) mod error;
#[cfg(feature = "parquet")]
mod parquet_log;
pub(crate) mod record;
pub(crate) mod replay;

pub use csv::{COLUMNS, Recording, create_csv, faults, numbers, write_csv};
pub use device_record::{device_file, read_device, write_device};
#[cfg(feature = "parquet")]
pub use parquet_log::create_parquet;
pub use record::SampleWriter;
pub use replay::ReplayError;
