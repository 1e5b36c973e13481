//! Errors of assembly searches.

use std::path::PathBuf;

/// Why a search for assemblies cannot begin, or did not end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AssemblyError {
    /// Too few or too many parts.
    #[error("an assembly has 2 to {most} parts, found {found}")]
    PartCount {
        /// Parts given.
        found: usize,
        /// Parts allowed.
        most: usize,
    },
    /// A number that is no part's.
    #[error("{item} names part {found} (from 0), but there are {parts} parts")]
    NoSuchPart {
        /// `fixed` or `placed`.
        item: &'static str,
        /// The number given.
        found: usize,
        /// Parts given.
        parts: usize,
    },
    /// A part has two places.
    #[error("part `{part}` is placed twice")]
    PlacedTwice {
        /// Its name.
        part: String,
    },
    /// A pose is not one.
    #[error("the pose of part `{part}` must be finite with a unit quaternion")]
    Pose {
        /// Its name.
        part: String,
    },
    /// An option is out of range.
    #[error("assembly option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// No two parts fit together.
    #[error(
        "contact holds no part in any other: check that they belong together and have one unit, or \
         allow a wider mating clearance"
    )]
    NothingFits,
    /// What an earlier search found cannot be used, or what this one finds cannot be kept.
    #[error(
        "{}: expected {expected}, found {found}; name another file to search afresh",
        file.display()
    )]
    Journal {
        /// The file.
        file: PathBuf,
        /// What it should hold.
        expected: String,
        /// What it holds, or why it cannot be used.
        found: String,
    },
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}
