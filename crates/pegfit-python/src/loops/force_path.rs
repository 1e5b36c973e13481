//! One tick of the loop, for simulations that step by themselves.

use std::sync::{Mutex, PoisonError};

use fft_correlate::Pose;
use glam::DVec3;
use haptic::{DeviceSpec, DeviceState, ForcePath, Sample, Workspace};
use pyo3::prelude::*;

use super::settings;
use crate::failure::raised::{Failure, Kind};
use crate::poses;
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::guarded;

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
    source: AnySource,
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
        source: &AnySource,
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
    fn new(source: &Source, config: &str, grip: [f64; 3]) -> Result<Self, Failure> {
        let source = source.get()?;
        let config = settings::device(config)?;
        let grip = DVec3::from_array(grip);
        if !grip.is_finite() {
            return Err(Failure::found(Kind::Device, "grip", "finite numbers", grip));
        }
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
