//! The format of a table's files: its version, and the arrays of its energies.

use serde_json::json;

use crate::pair::contact::Smoothing;
use crate::rotations::grid::RotationGrid;
use crate::table::spec::TableSpec;
use crate::table::store::array::{Chunking, Numbers, TableArray};

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 6;

/// One chunk of coefficients for each rotation node; stored numbers are `unit` joules each.
pub(super) fn coefficient_array(spec: &TableSpec, unit: f64, grid: &RotationGrid) -> TableArray {
    let name = match Smoothing::of_recipe(&spec.recipe) {
        Some(_) => "cubic B-spline coefficients of the energy, without what contact adds",
        None => "cubic B-spline coefficients of the energy",
    };
    // Readers that follow the CF conventions multiply by the scale factor and find joules.
    let attributes = json!({
        "long_name": name, "units": "J", "scale_factor": unit, "coordinates": "quaternion",
    });
    let [nx, ny, nz] = spec.window.shape();
    TableArray::new(
        ["coefficients", "coefficients/zarr.json"],
        Numbers::Float16,
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
