//! Why no scene can be made of a file.

use std::path::PathBuf;

use sdf_grid::MeshError;
use sdf_grid::atomic::AtomicError;
use sdf_grid::text::quoted;

/// Why no scene can be made of a file. Every variant names the file.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A mesh cannot be read, used or written.
    #[error(transparent)]
    Mesh(Box<MeshError>),
    /// The description does not follow its format, or asks for what is not read here.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// The element, or the byte, where it is.
        place: String,
        /// What would have been accepted.
        expected: String,
        /// What is there.
        found: String,
    },
    /// No solid, or several, are called so.
    #[error("{}: {option}: expected the name or number of one of {known}, found {}", path.display(), quoted(wanted))]
    Solid {
        /// The file.
        path: PathBuf,
        /// `--moving` or `--fixed`.
        option: &'static str,
        /// The name or number given.
        wanted: String,
        /// Numbers and names of the solids there are.
        known: String,
    },
    /// Nothing is in reach of what moves.
    #[error("{}: expected solids within {reach:.4} m of {moving}, found none", path.display())]
    Alone {
        /// The file.
        path: PathBuf,
        /// Name of what moves.
        moving: String,
        /// How far from its box was looked, metres.
        reach: f64,
    },
    /// The scene cannot be written.
    #[error(transparent)]
    Write(#[from] AtomicError),
}

impl From<MeshError> for ImportError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(Box::new(error))
    }
}
