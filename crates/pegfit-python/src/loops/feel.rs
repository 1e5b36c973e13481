//! The loop with the simulated hand.

use std::path::PathBuf;
use std::sync::Arc;

use haptic::log::{COLUMNS, numbers};
use haptic::{
    Clock, Device, DeviceSpec, Geometry, HandConfig, HapticConfig, Outcome, Script, Session,
    SimulatedHand,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pegfit::SessionReport;
use pyo3::prelude::*;
use sdf_grid::atomic;

use super::settings;
use crate::failure::raised::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::{Watch, guarded, run};

fn script_named(name: &str) -> Result<Script, Failure> {
    match name {
        "collision" => Ok(Script::Collision),
        "snap" => Ok(Script::Snap),
        "free" => Ok(Script::Free),
        other => {
            let expected = "collision, snap or free";
            Err(Failure::found(Kind::Device, "script", expected, other))
        }
    }
}

fn hold(
    parts: &Parts,
    source: &AnySource,
    script: Script,
    hand: HandConfig,
    clock: Clock,
    watch: &Watch,
) -> Result<(DeviceSpec, Outcome), Failure> {
    let (setup, fit) = (&parts.setup, &parts.fit);
    let pivot = parts.pair(watch)?.pivot();
    let placed = setup.placement.moving;
    let moving = setup
        .moving
        .transformed(placed.rotation, placed.translation);
    let source = source.as_source();
    let geometry = Geometry::of_fit(source, &moving, fit.assembled, fit.axis, fit.depth);
    let workspace = parts.device.workspace(fit.assembled, placed.apply(pivot));
    let seconds = hand.duration;
    let mut hand = SimulatedHand::new(hand, script, geometry, workspace);
    let session = Session::new(parts.device.clone(), workspace).keep_samples();
    let outcome = session.run(&mut hand, source, clock, seconds, watch.flag())?;
    Ok((hand.spec().clone(), outcome))
}

/// Every tick as a row of the log's columns, NaN where there was no input.
fn rows(outcome: &Outcome) -> Array2<f64> {
    let mut rows = Array2::from_elem((outcome.samples.len(), COLUMNS.len() - 1), f64::NAN);
    for (mut row, sample) in rows.rows_mut().into_iter().zip(&outcome.samples) {
        for (cell, value) in row.iter_mut().zip(numbers(sample)) {
            *cell = value.unwrap_or(f64::NAN);
        }
    }
    rows
}

/// Names of the columns of the ticks.
#[pyfunction]
pub(crate) fn tick_columns() -> Vec<&'static str> {
    COLUMNS[..COLUMNS.len() - 1].to_vec()
}

/// A run of the loop.
#[pyclass(frozen, module = "pegfit._core")]
pub(crate) struct Felt {
    title: String,
    subject: String,
    spec: DeviceSpec,
    config: HapticConfig,
    outcome: Outcome,
}

#[pymethods]
impl Felt {
    /// Every tick as a row.
    fn ticks<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        py.detach(|| rows(&self.outcome)).into_pyarray(py)
    }

    /// Counts, quantiles and energy balance as JSON.
    fn summary(&self) -> Result<String, Failure> {
        serde_json::to_string_pretty(&self.outcome.report)
            .map_err(|e| Failure::of(Kind::General, &e))
    }

    /// The page of the run as HTML.
    fn page(&self, py: Python<'_>) -> Result<String, Failure> {
        let page = SessionReport {
            title: self.title.clone(),
            subject: self.subject.clone(),
            spec: &self.spec,
            config: &self.config,
            outcome: &self.outcome,
            events: &[],
            pairs: Vec::new(),
        };
        let drawn = || page.html().map_err(|e| Failure::of(Kind::General, &e));
        py.detach(|| guarded(drawn))
    }
}

/// Writes a file whole or not at all.
#[pyfunction]
pub(crate) fn write_text(path: PathBuf, text: &str) -> Result<(), Failure> {
    atomic::write(&path, text.as_bytes())
        .map_err(|e| Failure::of(Kind::General, &e).in_file(path.display()))
}

/// Runs the loop; `subject` is what its page says was felt.
#[pyfunction]
#[pyo3(signature = (pair, source, script, seconds, hand, real_time, subject, progress))]
#[expect(clippy::too_many_arguments, reason = "what is asked of a run")]
pub(crate) fn feel(
    py: Python<'_>,
    pair: &PyPair,
    source: &Source,
    script: &str,
    seconds: f64,
    hand: &str,
    real_time: bool,
    subject: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Felt> {
    if !(seconds.is_finite() && seconds > 0.0) {
        let expected = "a positive number";
        return Err(Failure::found(Kind::Device, "seconds", expected, seconds).into());
    }
    let (script, source) = (script_named(script)?, source.get()?);
    let hand = HandConfig {
        duration: seconds,
        ..settings::hand(hand)?
    };
    let clock = match real_time {
        true => Clock::Real,
        false => Clock::Simulated,
    };
    let parts = Arc::clone(&pair.parts);
    let config = parts.device.clone();
    let (spec, outcome) = run(py, progress.as_ref(), move |watch| {
        hold(&parts, &source, script, hand, clock, watch)
    })?;
    Ok(Felt {
        title: SessionReport::title(Some(script), &spec.name),
        subject,
        spec,
        config,
        outcome,
    })
}
