//! The parts' surfaces, for tables whose energies lack what their contact adds.

use glam::DVec3;
use sdf_grid::{ContactError, KernelError, RepairOptions, TriangleMesh};

use crate::pair::contact::{Contact, Smoothing, jump};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
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

/// Writes the surfaces of both parts.
pub(super) fn write(files: &TableFiles, contact: &Contact) -> Result<(), StoreError> {
    let sizes = PartSize::of(contact);
    for (((part, size), names), name) in
        (contact.parts().into_iter().zip(sizes).zip(ARRAYS)).zip(PARTS)
    {
        let [vertices, triangles] = size.arrays(name, names);
        let numbers = part.vertices().iter().flat_map(|v| v.to_array());
        vertices.write_whole(files, numbers.flat_map(f64::to_le_bytes).collect())?;
        let corners = part.triangles().as_flattened().iter();
        triangles.write_whole(files, corners.flat_map(|c| c.to_le_bytes()).collect())?;
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
    let [vertices, triangles] = size.arrays(name, names);
    let [count, corners] = [size.vertices, size.triangles].map(|n| n.saturating_mul(3));
    let numbers = vertices.read_whole(files, count, f64::from_le_bytes)?;
    let corners = triangles.read_whole(files, corners, u32::from_le_bytes)?;
    let vertices = numbers.as_chunks().0.iter().map(|v| DVec3::from_array(*v));
    // A part that was cleaned before stays as it is.
    let options = RepairOptions {
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
