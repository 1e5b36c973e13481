//! Why a log could not be written or read.

use std::path::PathBuf;

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The log.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// The file is not such a log.
    #[error("{} line {line}: expected {expected}, found {found}", path.display())]
    Format {
        /// The log.
        path: PathBuf,
        /// Counted from 1.
        line: u64,
        /// What belongs there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The writing thread panicked.
    #[error("the log writer of {} failed: {reason}", path.display())]
    Writer {
        /// The log.
        path: PathBuf,
        /// The panic's message.
        reason: String,
    },
}
