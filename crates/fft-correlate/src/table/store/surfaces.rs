//! The parts' surfaces, for tables whose energies lack what their contact adds.

use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{ContactError, HygieneOptions, KernelError, TriangleMesh};
use zarrs::array::{Array, ArrayBuilder, ArrayError, ElementOwned};

use crate::pair::contact::{Contact, Smoothing, jump};
use crate::table::store::backend::Backend;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::{array, metadata_options, one_thread};
use crate::table::store::header::Header;
use crate::table::store::part_size::PartSize;

/// Name and metadata file of the vertices and of the triangles of the fixed and the moving part.
const ARRAYS: [[[&str; 2]; 2]; 2] = [
    [
        ["fixed_vertices", "fixed_vertices/zarr.json"],
        ["fixed_triangles", "fixed_triangles/zarr.json"],
    ],
    [
        ["moving_vertices", "moving_vertices/zarr.json"],
        ["moving_triangles", "moving_triangles/zarr.json"],
    ],
];

/// Their names.
const PARTS: [&str; 2] = ["fixed", "moving"];

/// What a checksum adds to an array's numbers, bytes.
const CHECKSUM: u64 = 4;

/// Writes the surfaces of both parts.
pub(super) fn write(
    files: &Arc<Backend>,
    contact: &Contact,
) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let sizes = PartSize::of(contact);
    for (((part, size), names), name) in
        (contact.parts().into_iter().zip(sizes).zip(ARRAYS)).zip(PARTS)
    {
        let [vertices, triangles] = size.builders(name);
        let numbers: Vec<f64> = part.vertices().iter().flat_map(|v| v.to_array()).collect();
        let array = vertices.build(files.clone(), &format!("/{}", names[0][0]))?;
        array.store_metadata_opt(&metadata_options())?;
        array.store_chunk_opt(&[0, 0], &numbers, &one_thread())?;
        let array = triangles.build(files.clone(), &format!("/{}", names[1][0]))?;
        array.store_metadata_opt(&metadata_options())?;
        array.store_chunk_opt(&[0, 0], part.triangles().as_flattened(), &one_thread())?;
    }
    Ok(())
}

/// Reads both surfaces and prepares their sum; none for a table of densities that were not
/// smoothed.
pub(super) fn read(files: &TableFiles, header: &Header) -> Result<Option<Contact>, StoreError> {
    let metadata = |item, reason: String| StoreError::Metadata {
        path: files.place().into(),
        item,
        reason,
    };
    let recipe = &header.table.recipe;
    let (Some(smoothing), Some(sizes)) = (Smoothing::of_recipe(recipe), header.parts) else {
        return match Smoothing::of_recipe(recipe) {
            Some(_) => Err(metadata("attribute parts", "there is none".into())),
            None => Ok(None),
        };
    };
    let hashes = [&recipe.fixed, &recipe.moving].map(|f| f.as_ref().map_or("", |f| &f.mesh));
    let mut parts = Vec::with_capacity(2);
    for (((size, names), name), hash) in sizes.into_iter().zip(ARRAYS).zip(PARTS).zip(hashes) {
        let part = read_part(files, size, name, names)?;
        if blake3::Hash::from_bytes(part.hash()).to_hex().as_str() != hash {
            let reason = "the surface is not that of the recipe".to_owned();
            return Err(metadata(names[0][1], reason));
        }
        parts.push(part);
    }
    let jump = jump(&recipe.model).map_err(|e: KernelError| metadata("sigma", e.to_string()))?;
    let contact = Contact::new(&parts[0], &parts[1], &smoothing, jump);
    contact
        .map(Some)
        .map_err(|e: ContactError| metadata("surfaces", e.to_string()))
}

fn read_part(
    files: &TableFiles,
    size: PartSize,
    name: &str,
    names: [[&'static str; 2]; 2],
) -> Result<TriangleMesh, StoreError> {
    let [vertices, triangles] = size.builders(name);
    let numbers: Vec<f64> = whole(files, names[0], &vertices, size.vertices, 8)?;
    let corners: Vec<u32> = whole(files, names[1], &triangles, size.triangles, 4)?;
    let vertices = numbers.as_chunks().0.iter().map(|v| DVec3::from_array(*v));
    // A part that was cleaned before stays as it is.
    let options = HygieneOptions {
        weld_tolerance: 0.0,
        max_open_fraction: 1.0,
    };
    let corners = corners.as_chunks().0.to_vec();
    TriangleMesh::clean(names[0][0], vertices.collect(), corners, &options)
        .map(|(mesh, _)| mesh)
        .map_err(|e| StoreError::Metadata {
            path: files.place().into(),
            item: names[0][1],
            reason: e.to_string(),
        })
}

/// All numbers of an array of `rows` by three numbers of `bytes` bytes each.
fn whole<T: ElementOwned>(
    files: &TableFiles,
    names: [&'static str; 2],
    builder: &ArrayBuilder,
    rows: usize,
    bytes: u64,
) -> Result<Vec<T>, StoreError> {
    let array: Array<Backend> = array(files, names, builder)?;
    let key = array.chunk_key(&[0, 0]).to_string();
    let damaged = |reason: String| StoreError::Damaged {
        path: files.place().into(),
        key: key.clone(),
        reason,
    };
    // Nothing is allocated for what is not there.
    let expected = (rows as u64)
        .saturating_mul(3 * bytes)
        .saturating_add(CHECKSUM);
    match files.size(&key)? {
        Some(found) if found == expected => {}
        found => {
            return Err(damaged(format!(
                "{expected} bytes expected, found {found:?}"
            )));
        }
    }
    let read = array.retrieve_chunk_opt::<Vec<T>>(&[0, 0], &one_thread());
    read.map_err(|e: ArrayError| damaged(e.to_string()))
}
