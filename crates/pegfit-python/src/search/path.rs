//! How does the moving part get to where it belongs?

use std::sync::Arc;
use std::time::Duration;

use fft_correlate::{DirectEvaluator, DirectOptions, EnergySource, Pose};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pegfit::PathReport;
use pegfit_path::{PathError, PathRequest, PathResult, PathSearch, Start};
use pyo3::prelude::*;
use sdf_grid::LengthUnit;

use crate::failure::raised::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::poses;
use crate::work::run::{Watch, guarded, run};

/// Longest search, seconds: a week, as for `pegfit path`.
const LONGEST: f64 = 604_800.0;

impl From<PathError> for Failure {
    fn from(error: PathError) -> Self {
        let kind = match &error {
            PathError::Cancelled => Kind::General,
            PathError::Pose { .. } => Kind::Pose,
            _ => Kind::Scene,
        };
        let said = Self::of(kind, &error);
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
        numbers(&self.report).into_pyarray(py)
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
                .map_err(|e| Failure::of(Kind::General, &e))
        })
    }

    /// The rows of `pegfit path -o`.
    fn table(&self) -> Result<String, Failure> {
        guarded(|| {
            let mut rows = Vec::new();
            let written = self.report.csv(&mut rows);
            written.map_err(|e| Failure::of(Kind::General, &e))?;
            Ok(String::from_utf8_lossy(&rows).into_owned())
        })
    }

    /// The page of `pegfit path --html`.
    fn page(&self) -> Result<String, Failure> {
        guarded(|| {
            self.report
                .html()
                .map_err(|e| Failure::of(Kind::General, &e))
        })
    }
}

fn numbers(report: &PathReport) -> Array2<f64> {
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
struct Question {
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
    let question = Question {
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
        let result = find(&parts, &question, watch)?;
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

fn find(parts: &Parts, question: &Question, watch: &Watch) -> Result<PathResult, Failure> {
    let setup = &parts.setup;
    let (fixed, moving) = (Arc::clone(&setup.fixed), Arc::clone(&setup.moving));
    let search = PathSearch::new(fixed, moving, question.options)?;
    let source = match question.solids_only {
        true => None,
        false => {
            let pair = parts.pair(watch)?;
            Some(DirectEvaluator::new(&pair, &DirectOptions::FULL)?)
        }
    };
    let source = source.as_ref().map(|s| s as &dyn EnergySource);
    Ok(search.find(&question.goal, source, watch)?)
}
