//! Files of loose parts, and the folders that hold them.

use std::path::{Path, PathBuf};
use std::time::Duration;

use pegfit_scene::{SolidOptions, SolidSet};
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
use sdf_grid::{LengthUnit, TriangleMesh};

use crate::args::ReadChoice;
use crate::error::CommandError;

/// Endings of the files that are read of a folder.
const MESHES: [&str; 8] = ["obj", "stl", "ply", "glb", "gltf", "3mf", "step", "stp"];

/// Parts by name, metres, and the unit that their file states.
pub(super) type NamedParts = (Vec<(String, TriangleMesh)>, Option<LengthUnit>);

/// The parts of a file: the whole file as one, called after it, or each of its solids.
pub(super) fn read_file(
    file: &Path,
    each_solid: bool,
    unit: LengthUnit,
    reading: &ReadChoice,
) -> Result<NamedParts, CommandError> {
    match each_solid {
        true => read_solids(file, unit, reading),
        false => read_whole(file, unit, reading),
    }
}

/// A file as one part.
fn read_whole(
    file: &Path,
    unit: LengthUnit,
    reading: &ReadChoice,
) -> Result<NamedParts, CommandError> {
    let limit = Duration::from_secs(reading.step_time_limit);
    let options =
        ReadOptions::choosing(unit, None, reading.segments_per_turn).within(limit, reading.lossy);
    let opened = MeshFile::open(file, &options.step)?;
    let (mesh, report) = opened.clean(&options)?;
    for warning in report.warnings() {
        remark!("{warning}");
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    Ok((vec![(stem.into_owned(), mesh)], opened.stated_unit()))
}

/// The solids of a file.
fn read_solids(
    file: &Path,
    unit: LengthUnit,
    reading: &ReadChoice,
) -> Result<NamedParts, CommandError> {
    let options = SolidOptions {
        unit,
        segments_per_turn: reading.segments_per_turn,
        step_time_limit: Duration::from_secs(reading.step_time_limit),
        lossy: reading.lossy,
        ..SolidOptions::default()
    };
    let set = SolidSet::read(file, &options)?;
    let solids = set.solids.iter().enumerate();
    let named = solids.map(|(i, solid)| (set.called(i), solid.mesh.clone()));
    Ok((named.collect(), Some(set.unit())))
}

/// The files that are named, and those of the folders that are named, in the order of their names.
pub(super) fn named_files(named: &[PathBuf]) -> Result<Vec<PathBuf>, CommandError> {
    let mut found = Vec::new();
    for path in named {
        match path.is_dir() {
            true => found.extend(mesh_files(path, false)?),
            false => found.push(path.clone()),
        }
    }
    Ok(found)
}

/// The mesh files of a folder, and those of the folders in it if `deep`, in the order of their names.
/// Links to folders are not followed.
pub(super) fn mesh_files(folder: &Path, deep: bool) -> Result<Vec<PathBuf>, CommandError> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|e| CommandError::read(&folder, e))?;
        for entry in entries {
            let entry = entry.map_err(|e| CommandError::read(&folder, e))?;
            let (file, kind) = (entry.path(), entry.file_type());
            let ending = file.extension().unwrap_or_default().to_string_lossy();
            if kind.is_ok_and(|k| k.is_dir()) {
                open.extend(deep.then_some(file));
            } else if MESHES.contains(&ending.to_lowercase().as_str()) {
                found.push(file);
            }
        }
    }
    if found.is_empty() {
        let expected = format!("files that end with {}", MESHES.join(", "));
        let name = folder.display().to_string();
        return Err(CommandError::input(name, "folder", expected, "none"));
    }
    found.sort();
    Ok(found)
}
