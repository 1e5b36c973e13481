//! What can be wrong with a table on disk.

use std::io;
use std::path::PathBuf;

use sdf_grid::provenance::Difference;

use crate::table::spec::TableError;

/// Why a table on disk cannot be made, read or extended.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// There is nothing at the path or URL.
    #[error("{}: no table there", path.display())]
    Missing {
        /// Where.
        path: PathBuf,
    },
    /// A URL that names no store.
    #[error("{}: {reason}", url.display())]
    Url {
        /// What was given.
        url: PathBuf,
        /// Why it cannot be used.
        reason: String,
    },
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file, folder or object.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The metadata is not that of a table.
    #[error("{}: {item} is not that of an energy table: {reason}", path.display())]
    Metadata {
        /// The table.
        path: PathBuf,
        /// Which file or attribute.
        item: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The table is of another format.
    #[error(
        "{0}: table format {expected} expected, {found} found; remove it and bake it again: \
         pegfit bake SCENE -o {0}",
        path.display()
    )]
    Version {
        /// The table.
        path: PathBuf,
        /// The format this program reads.
        expected: u32,
        /// The table's.
        found: u64,
    },
    /// The table at the path was baked from another pair or with another specification.
    #[error(
        "{}: a table with another {} is already there: {} is stored, {} is given",
        path.display(), difference.key, difference.stored, difference.given
    )]
    Different {
        /// The table.
        path: PathBuf,
        /// What differs first.
        difference: Difference,
    },
    /// Another process is baking the table.
    #[error("{}: another process is baking this table; wait, or let each bake its rank", path.display())]
    Busy {
        /// The table.
        path: PathBuf,
    },
    /// Rotation nodes are not baked yet.
    #[error(
        "{}: {missing} of {rotations} rotation nodes are missing, the first is {first}; bake with \
         resume",
        path.display()
    )]
    Incomplete {
        /// The table.
        path: PathBuf,
        /// How many.
        missing: usize,
        /// Of how many.
        rotations: usize,
        /// The first of them.
        first: usize,
    },
    /// A rotation node's chunk is truncated, does not pass its checksum, or is not the one that was
    /// baked for its place.
    #[error("{}: chunk {key} is damaged: {reason}; bake with resume", path.display())]
    Damaged {
        /// The table.
        path: PathBuf,
        /// File of the chunk within the table.
        key: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The specification is out of range, or the table too large.
    #[error(transparent)]
    Table(#[from] TableError),
}
