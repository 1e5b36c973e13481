//! The score of one rotation at every displacement of a window.

use std::sync::Arc;

use fft_correlate::{Correlator, Pose, TranslationWindow, top_peaks};
use glam::{DQuat, DVec3};
use ndarray::Array3;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::failure::raised::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::poses;
use crate::work::run::{guarded, run};

/// Bytes of a score.
const SCORE: u128 = 4;

/// The score, the first displacement and the spacing, metres.
type Scores = (Array3<f32>, DVec3, f64);

/// A rotation of the scene as one of the shapes.
fn in_shapes(parts: &Parts, rotation: DQuat) -> DQuat {
    let pose = Pose::new(rotation, DVec3::ZERO);
    parts.setup.placement.to_shapes(&pose).rotation
}

fn scores(
    parts: &Parts,
    rotation: DQuat,
    window: Option<([f64; 3], [f64; 3])>,
    watch: &crate::work::run::Watch,
) -> Result<Scores, Failure> {
    let (setup, pair) = (&parts.setup, parts.pair(watch)?);
    let (min, max) = match window {
        Some((min, max)) => (DVec3::from_array(min), DVec3::from_array(max)),
        None => {
            let middle = setup.center + pair.displacement(&setup.assembled);
            (middle - setup.reach(), middle + setup.reach())
        }
    };
    let window = TranslationWindow::new(min, max, pair.spacing())?;
    let lattice = *window.lattice();
    let support = fft_correlate::correlate::PairSupport::of(&pair)?;
    let plan = fft_correlate::correlate::CorrelatorPlan::new(&support, &window)?;
    let needed = u128::from(plan.bytes(1)) + SCORE * lattice.len() as u128;
    if needed > u128::from(parts.memory) {
        return Err(Failure::memory(
            Kind::Scene,
            "the correlation",
            needed,
            parts.memory,
        ));
    }
    let correlator = Correlator::build(&plan, &pair)?;
    let mut score = Array3::zeros(window.shape());
    let turn = in_shapes(parts, rotation);
    correlator.score(turn, &mut correlator.scratch(), score.view_mut());
    pair.add_contact(turn, &window, score.view_mut());
    Ok((score, lattice.origin(), lattice.spacing()))
}

type ScoreArrays<'py> = (Bound<'py, PyArray3<f32>>, [f64; 3], f64);

/// The score of a rotation (of the scene, x y z w) at every displacement of a window of the
/// shapes, cubic metres; the first displacement and the spacing, metres.
#[pyfunction]
#[pyo3(signature = (pair, rotation, window, progress))]
pub(crate) fn correlate<'py>(
    py: Python<'py>,
    pair: &PyPair,
    rotation: [f64; 4],
    window: Option<([f64; 3], [f64; 3])>,
    progress: Option<Py<PyAny>>,
) -> PyResult<ScoreArrays<'py>> {
    let rotation = poses::quaternion(rotation)?;
    let parts = Arc::clone(&pair.parts);
    let (score, origin, spacing) = run(py, progress.as_ref(), move |watch| {
        scores(&parts, rotation, window, watch)
    })?;
    Ok((score.into_pyarray(py), origin.to_array(), spacing))
}

/// Poses in the scene of displacements (n, 3) of the shapes at a rotation of the scene.
#[pyfunction]
pub(crate) fn poses_at<'py>(
    py: Python<'py>,
    pair: &PyPair,
    rotation: [f64; 4],
    displacements: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rotation = poses::quaternion(rotation)?;
    let displacements = displacements.as_array().to_owned();
    let parts = Arc::clone(&pair.parts);
    let rows = run(py, None, move |watch| {
        let (pair, placement) = (parts.pair(watch)?, parts.setup.placement);
        let turn = in_shapes(&parts, rotation);
        let rows = displacements.rows().into_iter().map(|d| {
            let shapes = pair.pose(turn, DVec3::new(d[0], d[1], d[2]));
            poses::row(&placement.to_scene(&shapes))
        });
        Ok(poses::array(rows))
    })?;
    Ok(rows.into_pyarray(py))
}

/// Indices (k, 3) of the highest local maxima more than `radius` nodes apart, highest first.
#[pyfunction]
pub(crate) fn highest(
    scores: PyReadonlyArray3<'_, f32>,
    count: usize,
    radius: f64,
) -> Result<Vec<[usize; 3]>, Failure> {
    guarded(|| {
        let peaks = top_peaks(scores.as_array(), count, radius);
        Ok(peaks.into_iter().map(|peak| peak.index).collect())
    })
}
