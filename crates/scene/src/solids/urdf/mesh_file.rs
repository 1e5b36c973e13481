//! The file that a mesh names.

use std::path::{Path, PathBuf};

use sdf_grid::{Ledger, LedgerKind};

use crate::solids::element::Element;
use crate::solids::error::ImportError;

/// Relative to the description, or, of `package://name/rest`, `name/rest` in a folder above it, or
/// else `rest` in one.
pub(super) fn resolve(
    path: &Path,
    mesh: &Element,
    ledger: &mut Ledger,
) -> Result<PathBuf, ImportError> {
    let name = mesh.required(path, "filename")?;
    let file = located(path, mesh, name, ledger)?;
    let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("dae") => {
            let expected = "an .obj, .stl, .ply, .glb or .3mf file (Blender, assimp and trimesh \
                            convert Collada)";
            return Err(mesh.wrong(path, expected, format!("{name:?}")));
        }
        Some("glb" | "gltf") => {
            ledger.add(
                LedgerKind::Assumed,
                "axes of a mesh",
                "as its glTF file has them",
            );
        }
        _ => {}
    }
    Ok(file)
}

fn located(
    path: &Path,
    mesh: &Element,
    name: &str,
    ledger: &mut Ledger,
) -> Result<PathBuf, ImportError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = name.strip_prefix("file://").unwrap_or(name);
    let package = name
        .strip_prefix("package://")
        .or(name.strip_prefix("model://"));
    let Some(package) = package else {
        return Ok(folder.join(name));
    };
    let rest = package.split_once('/').map_or(package, |(_, rest)| rest);
    let here = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    let absolute = here.canonicalize().unwrap_or(folder.to_owned());
    let above = |wanted: &str| {
        let mut candidates = absolute.ancestors().map(|folder| folder.join(wanted));
        candidates.find(|candidate| candidate.is_file())
    };
    if let Some(found) = above(package) {
        return Ok(found);
    }
    let Some(found) = above(rest) else {
        let expected = format!("{package} or {rest} in a folder above the file");
        return Err(mesh.wrong(path, expected, "none"));
    };
    let package = package.split('/').next().unwrap_or_default();
    let item = format!("folder of package {package:?}");
    let folder = found.to_string_lossy();
    let folder = folder.strip_suffix(rest).unwrap_or(&folder);
    ledger.add(LedgerKind::Assumed, &item, folder);
    Ok(found)
}
