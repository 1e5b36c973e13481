//! The loop with the simulated hand.

use std::sync::Arc;

use haptic::log::{COLUMNS, numbers};
use haptic::{Clock, Geometry, HandConfig, Outcome, Script, Session, SimulatedHand};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use super::settings;
use crate::failure::raised::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::{Watch, run};

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
) -> Result<Outcome, Failure> {
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
    Ok(session.run(&mut hand, source, clock, seconds, watch.flag())?)
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

/// Runs the loop: every tick, and the report as JSON.
#[pyfunction]
#[pyo3(signature = (pair, source, script, seconds, hand, real_time, progress))]
pub(crate) fn feel<'py>(
    py: Python<'py>,
    pair: &PyPair,
    source: &Source,
    script: &str,
    seconds: f64,
    hand: &str,
    real_time: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, String)> {
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
    let (ticks, report) = run(py, progress.as_ref(), move |watch| {
        let outcome = hold(&parts, &source, script, hand, clock, watch)?;
        let report = serde_json::to_string_pretty(&outcome.report)
            .map_err(|e| Failure::of(Kind::General, &e))?;
        Ok((rows(&outcome), report))
    })?;
    Ok((ticks.into_pyarray(py), report))
}
