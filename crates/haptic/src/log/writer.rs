//! What a file format for logs must do.

use std::path::PathBuf;

use crate::device::contract::DeviceSpec;
use crate::log::error::RecordError;
use crate::path::sample::Sample;

/// A file format for logs, written by the log's own thread.
pub trait SampleWriter: Send {
    /// Takes what the device of the run can do, before the first sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn begin(&mut self, device: &DeviceSpec) -> Result<(), RecordError> {
        let _ = device;
        Ok(())
    }

    /// Takes the next sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError>;

    /// Hands all that was taken to the system, so that it is there whatever ends this process. Called
    /// many times a second.
    ///
    /// # Errors
    /// If it cannot be written.
    fn flush(&mut self) -> Result<(), RecordError> {
        Ok(())
    }

    /// Puts the file, whole, in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    fn finish(self: Box<Self>) -> Result<(), RecordError>;

    /// The file that is written to while the loop runs, for messages.
    fn path(&self) -> PathBuf;
}
