//! Correlation, docking and path search.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use fft_correlate::dock::Ranking;
use fft_correlate::mating::JointKind;
use fft_correlate::{
    Correlator, Docking, DockingPose, DockingRequest, EnergySource, Placement, Pose,
    TranslationWindow, WatchedTiles, top_peaks,
};
use glam::{DQuat, DVec3};
use ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pegfit::PathReport;
use pegfit_path::{PathError, PathRequest, PathResult, PathSearch, Start};
use pyo3::prelude::*;
use sdf_grid::{Aabb, LengthUnit, TriangleMesh};

use crate::failure::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::parts::Mesh;
use crate::poses;
use crate::work::{Watch, guarded, run};

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
    watch: &crate::work::Watch,
) -> Result<Scores, Failure> {
    let setup = &parts.setup;
    let displacements = match window {
        Some((min, max)) => Aabb {
            min: DVec3::from_array(min),
            max: DVec3::from_array(max),
        },
        None => setup.displacements(parts.pivot()?),
    };
    let Aabb { min, max } = displacements;
    let window = TranslationWindow::new(min, max, setup.plan_unlimited()?.spacing())?;
    let pair = parts.pair_in(&displacements, watch)?;
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
    let rows = run(py, None, move |_| {
        let (pivot, placement) = (parts.pivot()?, parts.setup.placement);
        let turn = in_shapes(&parts, rotation);
        let rows = displacements.rows().into_iter().map(|d| {
            let to = pivot + DVec3::new(d[0], d[1], d[2]);
            let shapes = Pose::new(turn, to - turn * pivot);
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

/// More poses than anybody reads, as for `pegfit dock`.
const MOST: usize = 100_000;

type Found<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<bool>>,
    [f64; 2],
    Vec<FoundJoint<'py>>,
);

/// A joint: kind, free motions, axis, point and pitch in the scene (NaN where it has none), travel along
/// and about the axis, and the poses that are alike (n, 7).
type FoundJoint<'py> = (
    &'static str,
    usize,
    [f64; 3],
    [f64; 3],
    f64,
    [f64; 2],
    [f64; 2],
    Bound<'py, PyArray2<f64>>,
);

/// Energy, fit quality, mating area, energy under the pair's model, half width, overlap, depth of
/// interference, condition, hold, information, mating share and escape of a pose.
fn pose_numbers(pose: &DockingPose) -> [f64; 12] {
    let found = &pose.found;
    [
        found.energy,
        pose.quality,
        pose.mating_area,
        pose.model_energy,
        found.half_width.unwrap_or(f64::NAN),
        pose.overlap,
        pose.interference.depth,
        pose.condition.unwrap_or(f64::NAN),
        pose.rank,
        pose.hold.information,
        pose.hold.share,
        pose.hold.escape,
    ]
}

fn found_joint<'py>(py: Python<'py>, pose: &DockingPose, placement: &Placement) -> FoundJoint<'py> {
    const NONE: [f64; 3] = [f64::NAN; 3];
    let joint = &pose.joint;
    let has_axis = joint.axis != DVec3::ZERO;
    let has_point = has_axis || joint.kind == JointKind::Ball;
    let axis = (placement.fixed.rotation * joint.axis).to_array();
    let point = placement.fixed.apply(joint.point).to_array();
    let alike = pose
        .alike
        .iter()
        .map(|p| poses::row(&placement.to_scene(p)));
    (
        joint.kind.name(),
        joint.kind.freedoms(),
        if has_axis { axis } else { NONE },
        if has_point { point } else { NONE },
        joint.pitch,
        joint.slide.map_or([f64::NAN; 2], |t| t.range),
        joint.turn.map_or([f64::NAN; 2], |t| t.range),
        poses::array(alike).into_pyarray(py),
    )
}

/// Poses at most, tolerance of fields, whether all rotations are scored, state file, whether energy ranks.
type DockSearch = (usize, Option<f64>, bool, Option<PathBuf>, bool);

/// A pose nearby, an axis (point and direction), parts that are there already; in the scene.
type DockKnown = (Option<[f64; 7]>, Option<[[f64; 3]; 2]>, Vec<Py<Mesh>>);

/// Poses in the scene (k, 7), their numbers (k, 12), whether each was refined, the rotations scored and
/// looked at, and the joints.
#[pyfunction]
#[pyo3(signature = (pair, search, known, progress))]
pub(crate) fn dock<'py>(
    py: Python<'py>,
    pair: &PyPair,
    search: DockSearch,
    known: DockKnown,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let (top, tolerance, exhaustive, state, by_energy) = search;
    let (near, axis, keep_apart) = known;
    if top == 0 || top > MOST {
        let expected = format!("1 to {MOST}");
        return Err(Failure::found(Kind::Scene, "top", expected, top).into());
    }
    let parts = Arc::clone(&pair.parts);
    let near = near.map(|row| poses::pose(&row, 0)).transpose()?;
    let others: Vec<_> = (keep_apart.iter())
        .map(|m| Arc::clone(&m.get().mesh))
        .collect();
    let (report, placement) = run(py, progress.as_ref(), move |watch| {
        let mut setup = parts.setup.clone();
        setup.builder.tolerance = tolerance.unwrap_or(setup.builder.tolerance);
        let placement = setup.placement;
        let back = placement.fixed.inverse();
        let there =
            |m: &Arc<TriangleMesh>| Arc::new(m.transformed(back.rotation, back.translation));
        let reach = 0.25 * setup.moving.bounds().diagonal();
        let request = DockingRequest {
            top,
            exhaustive,
            rotations: parts.rotations_named.then(|| parts.rotations.clone()),
            state,
            ranking: match by_energy {
                true => Ranking::Energy,
                false => Ranking::Contact,
            },
            near: near.map(|pose| (placement.to_shapes(&pose), reach, 30f64.to_radians())),
            axis: axis.map(|given| {
                let [point, direction] = given.map(DVec3::from_array);
                (
                    back.apply(point),
                    back.rotation * direction.normalize_or_zero(),
                )
            }),
            others: others.iter().map(there).collect(),
            ..DockingRequest::default()
        };
        Ok((Docking::new(&setup, request).run(watch)?, placement))
    })?;
    let rows = report.poses.iter();
    let scene = rows
        .clone()
        .map(|p| poses::row(&placement.to_scene(&p.found.pose)));
    let refined: Array1<bool> = rows.clone().map(|p| p.found.refined).collect();
    let joints = rows
        .clone()
        .map(|p| found_joint(py, p, &placement))
        .collect();
    let search = report.energy_search.as_ref();
    Ok((
        poses::array(scene).into_pyarray(py),
        poses::array(rows.map(pose_numbers)).into_pyarray(py),
        refined.into_pyarray(py),
        search.map_or([0.0; 2], |s| [s.scored as f64, s.rotations as f64]),
        joints,
    ))
}

/// Longest search, seconds: a week, as for `pegfit path`.
const LONGEST: f64 = 604_800.0;

impl From<PathError> for Failure {
    fn from(error: PathError) -> Self {
        let kind = match &error {
            PathError::Cancelled => Kind::General,
            PathError::Pose { .. } => Kind::Pose,
            _ => Kind::Scene,
        };
        let said = Self::from_error(kind, &error);
        match error {
            PathError::Option {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            _ => said,
        }
    }
}

/// A way, and what reports of it need.
#[pyclass(frozen, module = "pegfit._core", name = "Way")]
pub(crate) struct PyWay {
    report: PathReport,
}

#[pymethods]
impl PyWay {
    /// A row for each pose: the pose in the scene, way gone, overlap, energy, force, torque; the last
    /// seven are NaN without energies. (n, 16).
    fn numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        path_rows(&self.report).into_pyarray(py)
    }

    /// The motions inwards in words.
    fn words(&self) -> Vec<String> {
        self.report.words()
    }

    /// What `pegfit path --json` tells.
    fn summary(&self) -> Result<String, Failure> {
        guarded(|| {
            self.report
                .json()
                .map_err(|e| Failure::from_error(Kind::General, &e))
        })
    }

    /// The rows of `pegfit path -o`.
    fn table(&self) -> Result<String, Failure> {
        guarded(|| {
            let mut rows = Vec::new();
            let written = self.report.csv(&mut rows);
            written.map_err(|e| Failure::from_error(Kind::General, &e))?;
            Ok(String::from_utf8_lossy(&rows).into_owned())
        })
    }

    /// The page of `pegfit path --html`.
    fn page(&self) -> Result<String, Failure> {
        guarded(|| {
            self.report
                .html()
                .map_err(|e| Failure::from_error(Kind::General, &e))
        })
    }
}

fn path_rows(report: &PathReport) -> Array2<f64> {
    let rows = report.result.poses.iter().map(|at| {
        let pose = report.placement.to_scene(&at.pose);
        let [energy, force, torque] = match &at.response {
            Some(response) => {
                let wrench = report.placement.wrench_to_scene(&pose, &response.wrench);
                let (force, torque) = (wrench.force.to_array(), wrench.torque.to_array());
                [[response.energy; 3], force, torque]
            }
            None => [[f64::NAN; 3]; 3],
        };
        let mut row = [0.0; 16];
        row[..7].copy_from_slice(&poses::row(&pose));
        row[7..10].copy_from_slice(&[at.length, at.depth, energy[0]]);
        row[10..13].copy_from_slice(&force);
        row[13..].copy_from_slice(&torque);
        row
    });
    poses::array(rows)
}

/// What is asked of a way, poses in the scene.
struct PathQuery {
    goal: Pose,
    options: PathRequest,
    solids_only: bool,
}

/// The way to a pose in the scene (the fit without one), from a pose or from outside.
#[pyfunction]
#[pyo3(signature = (pair, goal, start, lengths, seconds, allow_overlap, solids_only, progress))]
#[expect(clippy::too_many_arguments, reason = "what is asked of a way")]
pub(crate) fn path(
    py: Python<'_>,
    pair: &PyPair,
    goal: Option<[f64; 7]>,
    start: Option<[f64; 7]>,
    lengths: [Option<f64>; 2],
    seconds: f64,
    allow_overlap: bool,
    solids_only: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyWay> {
    // Written so that NaN is refused.
    if !(seconds > 0.0 && seconds <= LONGEST) {
        let expected = "a positive number of seconds, a week at most";
        return Err(Failure::found(Kind::Scene, "seconds", expected, seconds).into());
    }
    let parts = Arc::clone(&pair.parts);
    let placement = parts.setup.placement;
    let goal = match goal {
        Some(row) => poses::pose(&row, 0)?,
        None => parts.fit.assembled,
    };
    let start = match start {
        Some(row) => Start::Pose(placement.to_shapes(&poses::pose(&row, 0)?)),
        None => Start::Outside,
    };
    let [tolerance, step] = lengths;
    let query = PathQuery {
        goal: placement.to_shapes(&goal),
        options: PathRequest {
            tolerance,
            step,
            time_limit: Duration::from_secs_f64(seconds),
            start,
            allow_overlap,
            ..PathRequest::default()
        },
        solids_only,
    };
    let name = parts.name.clone();
    let report = run(py, progress.as_ref(), move |watch| {
        let result = find(&parts, &query, watch)?;
        let setup = &parts.setup;
        Ok(PathReport {
            result,
            name,
            fixed: Arc::clone(&setup.fixed),
            moving: Arc::clone(&setup.moving),
            placement,
            unit: LengthUnit::Mm,
            field_seconds: None,
        })
    })?;
    Ok(PyWay { report })
}

fn find(parts: &Parts, query: &PathQuery, watch: &Watch) -> Result<PathResult, Failure> {
    let setup = &parts.setup;
    let (fixed, moving) = (Arc::clone(&setup.fixed), Arc::clone(&setup.moving));
    let search = PathSearch::new(fixed, moving, query.options)?;
    let tiles = match query.solids_only {
        true => None,
        false => Some(parts.energies(watch)?),
    };
    let source = tiles.as_ref().map(|tiles| tiles.watched(watch));
    let asked = source.as_ref().map(|s| s as &dyn EnergySource);
    let found = search.find(&query.goal, asked, watch);
    match source.as_ref().and_then(WatchedTiles::failure) {
        Some(failure) => Err(failure.clone().into()),
        None => Ok(found?),
    }
}
