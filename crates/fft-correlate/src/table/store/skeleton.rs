//! The files of a table without coefficients: metadata and coordinates.

use std::io;
use std::path::Path;
use std::sync::Arc;

use sdf_grid::atomic::AtomicFolder;
use serde_json::json;
use zarrs::array::codec::Crc32cCodec;
use zarrs::array::{ArrayBuilder, data_type};
use zarrs::group::GroupBuilder;

use crate::rotations::grid::RotationGrid;
use crate::table::storage::Numbers;
use crate::table::store::backend::Backend;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::{coefficient_array, metadata_options, one_thread, scale_array};
use crate::table::store::header::Header;
use crate::table::store::surfaces;

/// Writes the metadata of an empty table, its own last: what makes it one. In a store of objects,
/// processes that do this at the same time write the same bytes.
pub(super) fn place(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    let Some(folder) = files.folder() else {
        return write_skeleton(files.storage(), header, grid).map_err(|e| StoreError::Io {
            path: files.place().into(),
            source: io::Error::other(e.to_string()),
        });
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
    write_skeleton(beside.storage(), header, grid).map_err(|e| io(io::Error::other(e)))?;
    match folder.commit_new() {
        Ok(_) => Ok(()),
        Err(_) if path.join("zarr.json").exists() => Ok(()),
        Err(e) => Err(io(e.into())),
    }
}

type AnyError = Box<dyn std::error::Error + Send + Sync>;

fn write_skeleton(
    files: &Arc<Backend>,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), AnyError> {
    let window = &header.table.window;
    coefficient_array(&header.table, header.energy_unit, grid)
        .build(files.clone(), "/coefficients")?
        .store_metadata_opt(&metadata_options())?;
    if header.table.storage.numbers == Numbers::Integer {
        scale_array(header.energy_unit, grid)
            .build(files.clone(), "/scale")?
            .store_metadata_opt(&metadata_options())?;
    }
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f64> = (0..window.shape()[axis])
            .map(|i| window.position([i; 3]).to_array()[axis])
            .collect();
        let about = "displacement of the moving part's pivot";
        coordinate(files, name, &[(name, values.len())], &values, about, "m")?;
    }
    let quaternions: Vec<f64> = grid.nodes().iter().flat_map(|q| q.to_array()).collect();
    let shape = [("rotation", grid.nodes().len()), ("component", 4)];
    let about = "x, y, z, w";
    coordinate(files, "quaternion", &shape, &quaternions, about, "1")?;
    if let Some(contact) = &header.table.contact {
        surfaces::write(files, contact)?;
    }
    GroupBuilder::new()
        .attributes(header.attributes())
        .build(files.clone(), "/")?
        .store_metadata()?;
    Ok(())
}

fn coordinate(
    files: &Arc<Backend>,
    name: &str,
    shape: &[(&str, usize)],
    values: &[f64],
    about: &str,
    unit: &str,
) -> Result<(), AnyError> {
    let lengths: Vec<u64> = shape.iter().map(|(_, n)| *n as u64).collect();
    let attributes = json!({ "long_name": about, "units": unit });
    let array = ArrayBuilder::new(
        lengths.clone(),
        lengths.clone(),
        data_type::float64(),
        f64::NAN,
    )
    .dimension_names(Some(shape.iter().map(|(n, _)| *n)))
    .bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())])
    .attributes(attributes.as_object().cloned().unwrap_or_default())
    .build(files.clone(), &format!("/{name}"))?;
    array.store_metadata_opt(&metadata_options())?;
    array.store_chunk_opt(&vec![0; shape.len()], values, &one_thread())?;
    Ok(())
}
