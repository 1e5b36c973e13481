//! Whole files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::mesh::error::MeshError;

/// The bytes of a file.
pub(super) fn read_whole(path: &Path) -> Result<Vec<u8>, MeshError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|mut f| f.read_to_end(&mut bytes))
        .map_err(|source| MeshError::Read {
            path: path.to_owned(),
            source,
        })?;
    Ok(bytes)
}
