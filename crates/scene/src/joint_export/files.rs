//! The meshes beside a description.

use std::path::{Path, PathBuf};

use sdf_grid::mesh_io;

use super::error::ExportError;
use super::pair::DockedPair;

/// Names of the meshes beside a description, without folder.
pub(super) struct MeshNames {
    pub(super) fixed: String,
    pub(super) moving: String,
}

/// Writes the meshes of both parts, each in its own frame, in metres, as `STEM-fixed.obj` and
/// `STEM-moving.obj` beside `path`.
pub(super) fn write_meshes(pair: &DockedPair, path: &Path) -> Result<MeshNames, ExportError> {
    let no_name = || ExportError::NoName {
        path: path.to_owned(),
    };
    let stem = path.file_stem().ok_or_else(no_name)?.to_string_lossy();
    let names = MeshNames {
        fixed: format!("{stem}-fixed.obj"),
        moving: format!("{stem}-moving.obj"),
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = [&names.fixed, &names.moving].map(|name| folder.join(name));
    if let Some(mesh) = files.iter().find(|file| is_kept(pair, file)) {
        return Err(ExportError::Replaces {
            path: path.to_owned(),
            mesh: mesh.clone(),
        });
    }
    for (file, mesh) in files.iter().zip([pair.fixed, pair.moving]) {
        mesh_io::write_obj(file, mesh)?;
    }
    Ok(names)
}

/// Whether a file is one that must not be replaced.
fn is_kept(pair: &DockedPair, file: &Path) -> bool {
    let whole = |path: &Path| -> Option<PathBuf> { path.canonicalize().ok() };
    whole(file).is_some_and(|file| pair.kept.iter().any(|k| whole(k).as_ref() == Some(&file)))
}
