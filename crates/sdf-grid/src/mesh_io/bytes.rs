//! The bytes of files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::mesh::error::MeshError;

/// The bytes of a file.
pub(super) fn read_whole(path: &Path) -> Result<Vec<u8>, MeshError> {
    read_start(path, usize::MAX)
}

/// The first bytes of a file, at most so many.
pub(super) fn read_start(path: &Path, most: usize) -> Result<Vec<u8>, MeshError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|f| f.take(most as u64).read_to_end(&mut bytes))
        .map_err(|source| MeshError::Read {
            path: path.to_owned(),
            source,
        })?;
    Ok(bytes)
}
