//! Where does the moving part belong?

use std::path::PathBuf;
use std::sync::Arc;

use fft_correlate::{Docking, DockingPose, DockingRequest};
use ndarray::Array1;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::failure::raised::{Failure, Kind};
use crate::pair_class::PyPair;
use crate::poses;
use crate::work::run::run;

/// More poses than anybody reads, as for `pegfit dock`.
const MOST: usize = 100_000;

type Found<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<bool>>,
    [f64; 2],
);

/// Energy, depth, fit quality, mating area, energy under the pair's model, half width, overlap, depth of
/// interference and condition of a pose.
fn numbers(pose: &DockingPose) -> [f64; 9] {
    let found = &pose.found;
    let width = found.half_width.unwrap_or(f64::INFINITY);
    let condition = pose.condition.unwrap_or(f64::NAN);
    [
        found.energy,
        pose.depth,
        pose.quality,
        pose.mating_area,
        pose.model_energy,
        width,
        pose.overlap,
        pose.interference.depth,
        condition,
    ]
}

/// Poses in the scene (k, 7), their numbers (k, 9), whether each was refined, and the rotations
/// scored and looked at.
#[pyfunction]
#[pyo3(signature = (pair, top, tolerance, exhaustive, state, progress))]
pub(crate) fn dock<'py>(
    py: Python<'py>,
    pair: &PyPair,
    top: usize,
    tolerance: Option<f64>,
    exhaustive: bool,
    state: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    if top == 0 || top > MOST {
        let expected = format!("1 to {MOST}");
        return Err(Failure::found(Kind::Scene, "top", expected, top).into());
    }
    let parts = Arc::clone(&pair.parts);
    let (report, placement) = run(py, progress.as_ref(), move |watch| {
        let mut setup = parts.setup.clone();
        setup.builder.tolerance = tolerance.unwrap_or(setup.builder.tolerance);
        let options = DockingRequest {
            top,
            exhaustive,
            rotations: parts.rotations_named.then(|| parts.rotations.clone()),
            state,
            ..DockingRequest::default()
        };
        Ok((Docking::new(&setup, options).run(watch)?, setup.placement))
    })?;
    let rows = report.poses.iter();
    let scene = rows
        .clone()
        .map(|p| poses::row(&placement.to_scene(&p.found.pose)));
    let refined: Array1<bool> = rows.clone().map(|p| p.found.refined).collect();
    Ok((
        poses::array(scene).into_pyarray(py),
        poses::array(rows.map(numbers)).into_pyarray(py),
        refined.into_pyarray(py),
        [report.scored as f64, report.rotations as f64],
    ))
}
