//! The format of a table's files: its version, and the arrays of its energies.

use serde_json::json;

use crate::pair::contact::Smoothing;
use crate::rotations::grid::RotationGrid;
use crate::table::spec::TableSpec;
use crate::table::storage;
use crate::table::store::array::{Chunking, Numbers, TableArray};

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 6;

/// One chunk of coefficients for each rotation node; stored numbers are `unit` joules each.
pub(super) fn coefficient_array(spec: &TableSpec, unit: f64, grid: &RotationGrid) -> TableArray {
    // What readers that follow the CF conventions multiply by: they find joules. Whole numbers have
    // a scale per rotation, which those conventions cannot say: joules are the product of two
    // arrays.
    let name = match Smoothing::of_recipe(&spec.recipe) {
        Some(_) => "cubic B-spline coefficients of the energy, without what contact adds",
        None => "cubic B-spline coefficients of the energy",
    };
    let (numbers, attributes) = match spec.storage.numbers {
        storage::Numbers::Half => (
            Numbers::Float16,
            json!({
                "long_name": name, "units": "J", "scale_factor": unit,
                "coordinates": "quaternion",
            }),
        ),
        storage::Numbers::Integer => (
            Numbers::Int16,
            json!({
                "long_name": format!("{name}, as a multiple of scale"), "units": "1",
                "_FillValue": i16::MIN, "coordinates": "quaternion scale",
            }),
        ),
    };
    let [nx, ny, nz] = spec.window.shape();
    TableArray::new(
        ["coefficients", "coefficients/zarr.json"],
        numbers,
        &[
            ("rotation", grid.nodes().len()),
            ("x", nx),
            ("y", ny),
            ("z", nz),
        ],
        Chunking::PackedRows,
        attributes,
    )
}

/// What the whole numbers of each rotation node are multiplied by, in `unit` joules.
pub(super) fn scale_array(unit: f64, grid: &RotationGrid) -> TableArray {
    let attributes = json!({
        "long_name": "coefficient per whole number", "units": "J", "scale_factor": unit,
    });
    TableArray::new(
        ["scale", "scale/zarr.json"],
        Numbers::Float32,
        &[("rotation", grid.nodes().len())],
        Chunking::Rows,
        attributes,
    )
}
