//! What a file format for logs must do.

use std::path::PathBuf;

use crate::log::error::RecordError;
use crate::path::sample::Sample;

/// A file format for logs, written by the log's own thread.
pub trait SampleWriter: Send {
    /// Takes the next sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError>;

    /// Puts the file, whole, in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    fn finish(self: Box<Self>) -> Result<(), RecordError>;

    /// The file, for messages.
    fn path(&self) -> PathBuf;
}
