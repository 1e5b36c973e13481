//! The density of one part on a lattice.

use std::sync::Arc;

use num_complex::Complex32;
use numpy::{IntoPyArray, PyArray3};
use pyo3::prelude::*;
use sdf_grid::{DensityField, DensityKernel, DensityOptions, Lattice, Sampling};

use super::mesh::Mesh;
use crate::failure::raised::{Failure, Kind};
use crate::memory_budget;
use crate::work::run::run;

/// Lattice cells along the longest side unless a spacing is given: as `pegfit field`.
const DEFAULT_CELLS: f64 = 48.0;

type Arrays<'py> = (
    Bound<'py, PyArray3<Complex32>>,
    Bound<'py, PyArray3<Complex32>>,
    Bound<'py, PyArray3<f32>>,
    [f64; 3],
    f64,
);

/// Unit exterior and interior density, signed distance, first node and spacing, metres. Nothing is
/// copied: the arrays are those that were computed.
#[pyfunction]
#[pyo3(signature = (mesh, spacing, sigma, tolerance, margin, progress))]
pub(crate) fn density<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    spacing: Option<f64>,
    sigma: f64,
    tolerance: f64,
    margin: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Arrays<'py>> {
    let mesh = Arc::clone(&mesh.mesh);
    let field = run(py, progress.as_ref(), move |watch| {
        let kernel = DensityKernel::new(sigma)?;
        let bounds = mesh.bounds();
        let longest = bounds.size().max_element();
        let spacing = spacing.unwrap_or(longest / DEFAULT_CELLS);
        let lattice = Lattice::covering(&bounds, margin.unwrap_or(0.25 * longest), spacing)?;
        let (needed, limit) = (DensityField::memory_bytes(&lattice), memory_budget(None));
        if needed > limit {
            let what = "the density";
            return Err(Failure::memory(Kind::Scene, what, needed.into(), limit));
        }
        let options = DensityOptions {
            tolerance,
            sampling: Sampling::Point,
            ..DensityOptions::default()
        };
        Ok(DensityField::compute(
            &mesh, &kernel, &lattice, &options, watch,
        )?)
    })?;
    let lattice = *field.lattice();
    Ok((
        field.exterior.into_pyarray(py),
        field.interior.into_pyarray(py),
        field.signed_distance.into_pyarray(py),
        lattice.origin().to_array(),
        lattice.spacing(),
    ))
}
