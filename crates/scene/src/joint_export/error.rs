//! Why docked parts cannot be written.

use std::path::PathBuf;

use sdf_grid::MeshError;
use sdf_grid::atomic::AtomicError;

/// Why docked parts cannot be written. Every variant names the file.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A description cannot be written.
    #[error(transparent)]
    Write(#[from] AtomicError),
    /// A mesh beside it cannot be written.
    #[error(transparent)]
    Mesh(Box<MeshError>),
    /// The path ends in no file's name, so that the meshes beside it have none either.
    #[error("{}: expected the name of a file", path.display())]
    NoName {
        /// The path.
        path: PathBuf,
    },
    /// A mesh beside the description would replace a file that is read.
    #[error(
        "{}: its mesh {} would replace a mesh of the scene: give the file another name",
        path.display(), mesh.display()
    )]
    Replaces {
        /// The description.
        path: PathBuf,
        /// The mesh.
        mesh: PathBuf,
    },
    /// A GLB would be too large for the format.
    #[error(
        "{}: a GLB has 2 GiB of meshes at most, found {bytes} bytes: simplify the meshes",
        path.display()
    )]
    Large {
        /// The file.
        path: PathBuf,
        /// Of all meshes.
        bytes: usize,
    },
    /// A GLB cannot be put together.
    #[error("cannot write {}", path.display())]
    Glb {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<gltf::Error>,
    },
    /// The mates cannot be turned into text.
    #[error("cannot write {}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
}

impl From<MeshError> for ExportError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(Box::new(error))
    }
}
