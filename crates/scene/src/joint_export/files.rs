//! The meshes beside a description.

use std::path::{Path, PathBuf};

use sdf_grid::mesh_io;

use super::error::ExportError;
use super::tree::Model;

/// Writes the meshes of all parts, each in its own frame, in metres, as `STEM-PART.obj` beside `path`;
/// their names, without folder.
pub(super) fn write_meshes(model: &Model, path: &Path) -> Result<Vec<String>, ExportError> {
    let no_name = || ExportError::NoName {
        path: path.to_owned(),
    };
    let stem = path.file_stem().ok_or_else(no_name)?.to_string_lossy();
    let names = model.links.iter().map(|l| format!("{stem}-{}.obj", l.file));
    let names: Vec<String> = names.collect();
    let folder = path.parent().unwrap_or(Path::new(""));
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    if let Some(mesh) = files.iter().find(|file| is_kept(model.kept, file)) {
        return Err(ExportError::Replaces {
            path: path.to_owned(),
            mesh: mesh.clone(),
        });
    }
    for (file, link) in files.iter().zip(&model.links) {
        mesh_io::write_obj(file, link.mesh)?;
    }
    Ok(names)
}

/// Whether a file is one that must not be replaced.
fn is_kept(kept: &[PathBuf], file: &Path) -> bool {
    let whole = |path: &Path| -> Option<PathBuf> { path.canonicalize().ok() };
    whole(file).is_some_and(|file| kept.iter().any(|k| whole(k).as_ref() == Some(&file)))
}
