//! The arrays that say where a table's numbers lie. This program makes them from the header; they
//! are for other readers, which must not be told otherwise.

use serde_json::json;

use crate::rotations::grid::RotationGrid;
use crate::table::store::array::{Chunking, Numbers, TableArray};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::header::Header;

/// By how much a component of a rotation may differ: another system's sines differ in their last
/// bits.
const TURN: f64 = 1e-12;

/// Names and metadata files.
const ARRAYS: [[&str; 2]; 4] = [
    ["x", "x/zarr.json"],
    ["y", "y/zarr.json"],
    ["z", "z/zarr.json"],
    ["quaternion", "quaternion/zarr.json"],
];

/// A coordinate: its name, its array, its values, and by how much these may differ.
struct Coordinate {
    name: &'static str,
    array: TableArray,
    values: Vec<f64>,
    tolerance: f64,
}

fn coordinates(header: &Header, grid: &RotationGrid) -> [Coordinate; 4] {
    let window = &header.table.window;
    let array = |names, dimensions: &[(&str, usize)], about: &str, unit: &str| {
        let attributes = json!({ "long_name": about, "units": unit });
        TableArray::new(
            names,
            Numbers::Float64,
            dimensions,
            Chunking::One,
            attributes,
        )
    };
    let axis = |axis: usize| {
        let along = (0..window.shape()[axis]).map(|i| window.position([i; 3]).to_array()[axis]);
        let (names, values) = (ARRAYS[axis], along.collect::<Vec<_>>());
        let about = "displacement of the moving part's pivot";
        Coordinate {
            name: names[0],
            array: array(names, &[(names[0], values.len())], about, "m"),
            values,
            tolerance: 0.0,
        }
    };
    let shape = [("rotation", grid.nodes().len()), ("component", 4)];
    let rotations = Coordinate {
        name: ARRAYS[3][0],
        array: array(ARRAYS[3], &shape, "x, y, z, w", "1"),
        values: grid.nodes().iter().flat_map(|q| q.to_array()).collect(),
        tolerance: TURN,
    };
    [axis(0), axis(1), axis(2), rotations]
}

/// Writes the coordinates.
pub(super) fn write(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    for Coordinate { array, values, .. } in coordinates(header, grid) {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        array.write_whole(files, raw)?;
    }
    Ok(())
}

/// Refuses coordinates that do not follow from the header.
pub(super) fn expect(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    for coordinate in coordinates(header, grid) {
        let Coordinate { array, values, .. } = &coordinate;
        let found = array.read_whole(files, values.len(), f64::from_le_bytes)?;
        let mut pairs = values.iter().zip(&found);
        // What is no number differs.
        let agrees = |(a, b): (&f64, &f64)| (a - b).abs() <= coordinate.tolerance;
        if let Some(at) = pairs.position(|pair| !agrees(pair)) {
            return Err(StoreError::Metadata {
                path: files.place().into(),
                item: coordinate.name,
                reason: format!("value {at} must be {}, found {}", values[at], found[at]),
            });
        }
    }
    Ok(())
}
