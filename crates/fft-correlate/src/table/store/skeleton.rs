//! The files of a table without coefficients: metadata and coordinates.

use std::io;
use std::path::Path;

use sdf_grid::atomic::AtomicFolder;

use crate::rotations::grid::RotationGrid;
use crate::table::error::TableError;
use crate::table::store::coordinates;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::coefficient_array;
use crate::table::store::header::{Header, LONGEST};
use crate::table::store::surfaces;

/// Writes the metadata of an empty table, its own last: what makes it one. In a store of objects,
/// processes that do this at the same time write the same bytes.
pub(super) fn place(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    // What is written is to be read again.
    let text = serde_json::to_vec_pretty(&header.group()).map_err(|e| StoreError::Io {
        path: files.place().join("zarr.json"),
        source: e.into(),
    })?;
    if text.len() as u64 > LONGEST {
        return Err(TableError::Spec {
            name: "rotations",
            expected: "a list that fits in 16 MiB of metadata",
            found: format!("{} bytes", text.len()),
        }
        .into());
    }
    let Some(folder) = files.folder() else {
        return write_skeleton(files, header, grid);
    };
    place_folder(folder, header, grid)
}

/// Writes to a folder beside `path` and renames it. If another process was first, its table stays
/// and this one is dropped.
fn place_folder(path: &Path, header: &Header, grid: &RotationGrid) -> Result<(), StoreError> {
    let io = |source: io::Error| StoreError::Io {
        path: path.into(),
        source,
    };
    let folder = AtomicFolder::create(path).map_err(|e| io(e.into()))?;
    let beside = TableFiles::in_folder(folder.temporary())?;
    write_skeleton(&beside, header, grid)?;
    match folder.commit_new() {
        Ok(_) => Ok(()),
        Err(_) if path.join("zarr.json").exists() => Ok(()),
        Err(e) => Err(io(e.into())),
    }
}

fn write_skeleton(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    coefficient_array(&header.table, header.energy_unit, grid).write(files)?;
    coordinates::write(files, header, grid)?;
    if let Some(contact) = &header.table.contact {
        surfaces::write(files, contact)?;
    }
    files.set_json("zarr.json", &header.group())
}
