//! The haptic loop: one tick of it, a run with the simulated hand, and the force on a body.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use fft_correlate::{Pose, Twist};
use glam::DVec3;
use haptic::log::{COLUMNS, numbers};
use haptic::{
    BodyForce, BodyState, Clock, Device, DeviceSpec, DeviceState, ForcePath, Geometry,
    HapticConfig, OperatorConfig, Outcome, Sample, Script, Session, SimulatedOperator, Workspace,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pegfit::SessionReport;
use pyo3::prelude::*;
use sdf_grid::{TriangleMesh, atomic};
use serde_json::{Map, Value};

use crate::failure::{Failure, Kind};
use crate::pair_class::{Parts, PyPair};
use crate::poses;
use crate::source::{AnySource, LoopSource, Source};
use crate::work::{Watch, guarded, run};

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
    hand: OperatorConfig,
    clock: Clock,
    watch: &Watch,
) -> Result<(DeviceSpec, Outcome), Failure> {
    let (setup, fit) = (&parts.setup, &parts.fit);
    let pivot = parts.pivot()?;
    let placed = setup.placement.moving;
    let moving = setup
        .moving
        .transformed(placed.rotation, placed.translation);
    let source = source.for_loop(watch)?;
    let source = source.as_source();
    let geometry = Geometry::from_fit(source, &moving, fit.assembled, fit.axis, fit.depth);
    let workspace = parts.device.workspace(fit.assembled, placed.apply(pivot));
    let seconds = hand.duration;
    let mut hand = SimulatedOperator::new(hand, script, geometry, workspace);
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
    /// The fixed part and the moving one where the scene puts them.
    surfaces: Vec<TriangleMesh>,
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
            .map_err(|e| Failure::from_error(Kind::General, &e))
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
            parts: self.surfaces.clone(),
        };
        let drawn = || {
            page.html()
                .map_err(|e| Failure::from_error(Kind::General, &e))
        };
        py.detach(|| guarded(drawn))
    }
}

/// Writes a file whole or not at all.
#[pyfunction]
pub(crate) fn write_text(path: PathBuf, text: &str) -> Result<(), Failure> {
    atomic::write(&path, text.as_bytes())
        .map_err(|e| Failure::from_error(Kind::General, &e).in_file(path.display()))
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
    let hand = OperatorConfig {
        duration: seconds,
        ..hand_config(hand)?
    };
    let clock = match real_time {
        true => Clock::Real,
        false => Clock::Simulated,
    };
    let parts = Arc::clone(&pair.parts);
    let config = parts.device.clone();
    let setup = &parts.setup;
    let surfaces = [
        (&setup.fixed, setup.placement.fixed),
        (&setup.moving, setup.placement.moving),
    ];
    let surfaces = surfaces.map(|(mesh, at)| mesh.transformed(at.rotation, at.translation));
    let (spec, outcome) = run(py, progress.as_ref(), move |watch| {
        hold(&parts, &source, script, hand, clock, watch)
    })?;
    Ok(Felt {
        title: SessionReport::title(Some(script), &spec.name),
        subject,
        spec,
        config,
        outcome,
        surfaces: surfaces.into(),
    })
}

/// A simulated body in place of a device: it takes whatever force the settings allow.
fn body(rate: f64) -> DeviceSpec {
    DeviceSpec {
        name: "simulated body".into(),
        input_dof: 6,
        output_dof: 6,
        rate_controlled: false,
        max_force: f64::INFINITY,
        max_torque: f64::INFINITY,
        max_stiffness: f64::INFINITY,
        max_rotational_stiffness: f64::INFINITY,
        workspace: f64::INFINITY,
        nominal_rate: rate,
    }
}

/// The force path between a body and a source: gate, coupling, passivity, limits.
#[pyclass(frozen, module = "pegfit._core", name = "ForcePath")]
pub(crate) struct PyForcePath {
    source: LoopSource,
    period: f64,
    state: Mutex<State>,
}

struct State {
    path: ForcePath,
    last: Option<Sample>,
}

/// Force and torque about the part's origin, energy, coverage, gain, and flags.
type Step = ([f64; 3], [f64; 3], f64, f64, f64, u16);

impl State {
    fn step(
        &mut self,
        source: &LoopSource,
        part: &Pose,
        time: f64,
        period: f64,
    ) -> Result<Step, Failure> {
        let last = self.last.map(|sample| sample.time);
        if !time.is_finite() || last.is_some_and(|last| time < last) {
            let expected = "seconds, never less than before";
            return Err(Failure::found(Kind::Device, "t", expected, time));
        }
        let workspace = *self.path.workspace();
        let input = DeviceState::at_rest(workspace.device_pose(part), time);
        let dt = last.map_or(period, |last| time - last);
        let sample = self.path.step(source.as_source(), Some(&input), time, dt);
        self.last = Some(sample);
        // From the grip, where the loop has it, to the part's origin.
        let arm = part.rotation * workspace.grip;
        let wrench = workspace.scene_wrench(&sample.wrench).about(-arm);
        Ok((
            wrench.force.to_array(),
            wrench.torque.to_array(),
            sample.energy,
            sample.coverage,
            sample.gain,
            sample.flags,
        ))
    }
}

#[pymethods]
impl PyForcePath {
    /// `config` is JSON; `grip` the point of the part (metres, its frame) that the coupling holds.
    #[new]
    fn new(py: Python<'_>, source: &Source, config: &str, grip: [f64; 3]) -> PyResult<Self> {
        let source = source.get()?;
        let config = device_config(config)?;
        let grip = DVec3::from_array(grip);
        if !grip.is_finite() {
            return Err(Failure::found(Kind::Device, "grip", "finite numbers", grip).into());
        }
        let source = run(py, None, move |watch| source.for_loop(watch))?;
        let workspace = Workspace::new(config.workspace_scale, Pose::IDENTITY, grip);
        let scratch = source.as_source().scratch();
        let body = body(config.rate_hz);
        let path = guarded(|| Ok(ForcePath::new(&body, &config, workspace, scratch)?))?;
        Ok(Self {
            source,
            period: config.period(),
            state: Mutex::new(State { path, last: None }),
        })
    }

    /// One tick at the pose of the moving part in the scene, `time` seconds on the caller's clock.
    fn step(&self, py: Python<'_>, pose: [f64; 7], time: f64) -> Result<Step, Failure> {
        let part = poses::pose(&pose, 0)?;
        py.detach(|| {
            guarded(|| {
                let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
                state.step(&self.source, &part, time, self.period)
            })
        })
    }

    /// Stiffness (N/m, N·m/rad) in use.
    fn stiffness(&self) -> [f64; 2] {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let gains = state.path.gains();
        [gains.stiffness, gains.rotational_stiffness]
    }
}

/// Force and torque about the centre, energy and coverage where the step leads, and how often the
/// source was asked.
type BodyStep = ([f64; 3], [f64; 3], f64, f64, u32);

/// A force that takes no more energy out of a body's motion than there is.
#[pyclass(frozen, module = "pegfit._core", name = "BodyForce")]
pub(crate) struct PyBodyForce {
    source: LoopSource,
    state: Mutex<BodyForce>,
}

#[pymethods]
impl PyBodyForce {
    #[new]
    fn new(py: Python<'_>, source: &Source) -> PyResult<Self> {
        let source = source.get()?;
        let source = run(py, None, move |watch| source.for_loop(watch))?;
        let scratch = source.as_source().scratch();
        Ok(Self {
            source,
            state: Mutex::new(BodyForce::new(scratch)),
        })
    }

    /// One step of a body: the moving part's pose against the fixed one, the body's centre in its
    /// frame, twist (angular first) now and after the step without this force, the inverse of its
    /// inertia, and the seconds of the step and since the last one.
    #[expect(
        clippy::too_many_arguments,
        reason = "numbers from Python, named there"
    )]
    fn step(
        &self,
        py: Python<'_>,
        pose: [f64; 7],
        center: [f64; 3],
        twist: [f64; 6],
        free: [f64; 6],
        mobility: [[f64; 6]; 6],
        dt: f64,
        elapsed: f64,
    ) -> Result<BodyStep, Failure> {
        let numbers = twist.iter().chain(&free).chain(mobility.as_flattened());
        let finite = |x: &f64| x.is_finite();
        if !(numbers.chain(&center).all(finite) && dt > 0.0 && dt.is_finite()) {
            let expected = "finite numbers and a step longer than 0";
            let found = format!("{twist:?}, {free:?}, {mobility:?}, {dt} s");
            return Err(Failure::found(Kind::Device, "motion", expected, found));
        }
        let body = BodyState {
            part: poses::pose(&pose, 0)?,
            center: DVec3::from_array(center),
            twist: motion(&twist),
            free: motion(&free),
            mobility,
            dt,
            elapsed,
        };
        py.detach(|| {
            guarded(|| {
                let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
                let step = state.step(self.source.as_source(), &body);
                Ok((
                    step.wrench.force.to_array(),
                    step.wrench.torque.to_array(),
                    step.energy,
                    step.coverage,
                    step.evaluations,
                ))
            })
        })
    }

    /// Forgets what was.
    fn release(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.release();
    }
}

fn motion(twist: &[f64; 6]) -> Twist {
    let [a, b, c, x, y, z] = *twist;
    Twist {
        angular: DVec3::new(a, b, c),
        linear: DVec3::new(x, y, z),
    }
}

/// The loop's settings, the keys given as in the `[device]` table of a scene.
fn device_config(json: &str) -> Result<HapticConfig, Failure> {
    let config: HapticConfig = serde_json::from_str(json).map_err(|e| {
        let expected = "keys and numbers as in a scene's [device]";
        Failure::found(Kind::Device, "config", expected, e)
    })?;
    config.validate()?;
    Ok(config)
}

/// The simulated hand, with the numbers given by name.
fn hand_config(json: &str) -> Result<OperatorConfig, Failure> {
    let refused = |item: &str, expected: &str, found: &dyn std::fmt::Display| {
        Failure::found(Kind::Device, format!("hand: {item}"), expected, found)
    };
    let given: Map<String, Value> =
        serde_json::from_str(json).map_err(|e| refused("settings", "numbers by name", &e))?;
    let mut hand = OperatorConfig::default();
    for (key, value) in &given {
        let number = value.as_f64().filter(|v| v.is_finite() && *v >= 0.0);
        let number = number.ok_or_else(|| refused(key, "a number >= 0", value))?;
        let place = match key.as_str() {
            "mass" => &mut hand.mass,
            "stiffness" => &mut hand.stiffness,
            "damping" => &mut hand.damping,
            "inertia" => &mut hand.inertia,
            "rotational_stiffness" => &mut hand.rotational_stiffness,
            "rotational_damping" => &mut hand.rotational_damping,
            "tremor" => &mut hand.tremor,
            "rotational_tremor" => &mut hand.rotational_tremor,
            "push" => &mut hand.push,
            "seed" => {
                hand.seed = number as u64;
                continue;
            }
            other => {
                return Err(refused(
                    other,
                    "a key that a hand has",
                    &"none of that name",
                ));
            }
        };
        *place = number;
    }
    for (name, value) in [("mass", hand.mass), ("inertia", hand.inertia)] {
        if value <= 0.0 {
            return Err(refused(name, "a positive number", &value));
        }
    }
    Ok(hand)
}
