//! Why a log could not be written, read or replayed.

use std::path::{Path, PathBuf};

/// Why a log could not be written, read or replayed.
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
    /// The system took no more of a log: the disk is full, or the file as large as it may be.
    #[error(
        "the log {} was cut short: {source}; its first {ticks} ticks {}",
        path.display(), describe_part(part.as_deref())
    )]
    Cut {
        /// The log.
        path: PathBuf,
        /// Ticks that were written.
        ticks: u64,
        /// Where they are; `None` if they went into a device or a pipe.
        part: Option<PathBuf>,
        /// The system's reason.
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

fn describe_part(part: Option<&Path>) -> String {
    match part {
        Some(part) => format!("are in {}, which can be replayed", part.display()),
        None => "were written".into(),
    }
}
