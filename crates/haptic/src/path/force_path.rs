//! One tick of the force path: input to wrench, without clock, thread or allocation.

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};

use crate::config::ConfigError;
use crate::config::HapticConfig;
use crate::device::contract::{DeviceSpec, DeviceState};
use crate::device::workspace::Workspace;
use crate::path::coupling::{Coupling, Gains, SpringLimits};
use crate::path::gate::Gate;
use crate::path::limiter::Limiter;
use crate::path::passivity::{EnergyAccount, Passivity};
use crate::path::sample::{Sample, flags};

/// Share of the force and torque limits below which nothing is felt: an exchanged source may change
/// the wrench by so much without the force being let go.
const KNOCK: f64 = 0.02;

/// Joules by which an exchanged source may differ at the object and still be the same field there.
const SAME_ENERGY: f64 = 1e-8;

/// Gate, coupling, field, passivity and limits in a row, with their state.
#[derive(Debug)]
pub struct ForcePath {
    workspace: Workspace,
    gains: Gains,
    gate: Gate,
    coupling: Coupling,
    passivity: Passivity,
    limiter: Limiter,
    scratch: Scratch,
    held: Wrench,
    ticks: u64,
}

impl ForcePath {
    /// A path for one device and one kind of source; `scratch` is the source's.
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(
        spec: &DeviceSpec,
        config: &HapticConfig,
        workspace: Workspace,
        scratch: Scratch,
    ) -> Result<Self, ConfigError> {
        config.validate()?;
        let limiter = Limiter::new(spec, config);
        let gains = Gains::passive(spec, config);
        let senses_rotation = spec.input_dof >= 6;
        let lock_rotation = config.coupling.lock_rotation || !senses_rotation;
        let limits = SpringLimits {
            force: limiter.max_force(),
            torque: limiter.max_torque(),
        };
        let share = gains.rotational_stiffness / gains.stiffness;
        Ok(Self {
            workspace,
            gains,
            gate: Gate::new(config, senses_rotation),
            coupling: Coupling::new(
                gains,
                limits,
                &config.coupling,
                lock_rotation,
                workspace.scale,
            ),
            passivity: Passivity::new(&config.passivity, share, workspace.scale),
            limiter,
            scratch,
            held: Wrench::ZERO,
            ticks: 0,
        })
    }

    /// Stiffness and damping in use, after the device's bounds.
    pub fn gains(&self) -> Gains {
        self.gains
    }

    /// Where the device lies in the scene.
    pub fn workspace(&self) -> &Workspace {
        &self.workspace
    }

    /// Energy bookkeeping so far.
    pub fn account(&self) -> EnergyAccount {
        self.passivity.account()
    }

    /// One tick: the newest input (`None` if the device is gone), the loop's clock and the seconds
    /// since the last tick. The wrench to send is the sample's.
    pub fn step(
        &mut self,
        source: &dyn EnergySource,
        input: Option<&DeviceState>,
        now: f64,
        dt: f64,
    ) -> Sample {
        let dt = if dt.is_finite() { dt.max(0.0) } else { 0.0 };
        let admitted = self.gate.admit(input, now, dt);
        let mut sample = Sample {
            tick: self.ticks,
            time: now,
            dt,
            input: input.copied(),
            gain: admitted.gain,
            flags: admitted.flags,
            ..Sample::default()
        };
        self.ticks += 1;
        if admitted.reseat {
            self.coupling.release();
            self.passivity.rebase();
        }
        let wanted = match admitted.pose {
            Some(pose) => self.couple(source, &pose, dt, &mut sample),
            None => Wrench::ZERO,
        };
        let (wrench, limited) = self.limiter.limit(&wanted, sample.gain, dt);
        for (bit, on) in [
            (flags::NOT_FINITE, limited.not_finite),
            (flags::CLAMPED, limited.clamped),
            (flags::SLEWED, limited.slewed),
        ] {
            sample.flags |= if on { bit } else { 0 };
        }
        self.held = self.workspace.scene_wrench(&wrench);
        sample.wrench = wrench;
        sample.account = self.passivity.account();
        sample
    }

    /// Lets an exchanged source take effect: the energy balance starts from what it holds now, and
    /// a change that would be felt as a knock comes in from no force.
    fn take_changes(&mut self, source: &dyn EnergySource, grip: &Pose, sample: &mut Sample) {
        let at = self.coupling.object().unwrap_or(*grip);
        let part = self.workspace.part_pose(&at);
        let Some(change) = source.refresh(&part, &mut self.scratch) else {
            return;
        };
        sample.flags |= flags::CHANGED;
        self.passivity.exchange(change.energy, sample.gain);
        let knock = self
            .workspace
            .device_wrench(&self.workspace.grip_wrench(&at, &change.wrench));
        // Written so that numbers that are not finite count as a knock.
        let soft = knock.force.length() <= KNOCK * self.limiter.max_force()
            && knock.torque.length() <= KNOCK * self.limiter.max_torque();
        // What is known of the field holds on where nothing came or went: a part far away.
        if !(soft && change.energy.abs() < SAME_ENERGY) {
            self.coupling.forget_field();
        }
        if !soft {
            self.gate.restart();
            sample.gain = 0.0;
        }
    }

    /// Whether a force worth feeling comes from where the source knows no energy of its own.
    fn is_faded(&self, response: &Response) -> bool {
        let felt = self.workspace.device_wrench(&response.wrench);
        response.coverage < 1.0
            && (felt.force.length() > KNOCK * self.limiter.max_force()
                || felt.torque.length() > KNOCK * self.limiter.max_torque())
    }

    /// The device wrench at full strength.
    fn couple(
        &mut self,
        source: &dyn EnergySource,
        device: &Pose,
        dt: f64,
        sample: &mut Sample,
    ) -> Wrench {
        let grip = self.workspace.grip_pose(device);
        self.take_changes(source, &grip, sample);
        let (workspace, scratch) = (&self.workspace, &mut self.scratch);
        let out = self.coupling.step(&grip, dt, |at| {
            let answer = source.evaluate(&workspace.part_pose(at), scratch);
            Response {
                wrench: workspace.grip_wrench(at, &answer.wrench),
                ..answer
            }
        });
        if out.bad_source {
            sample.flags |= flags::BAD_SOURCE;
            self.gate.record_fault();
        }
        self.passivity
            .observe(&grip, out.potential, sample.gain, &self.held, dt);
        let damped = self.passivity.control(dt);
        if damped != Wrench::ZERO {
            sample.flags |= flags::DAMPED;
        }
        sample.object = self.workspace.part_pose(&out.object);
        if !source.is_loaded(&sample.object, &self.scratch) {
            sample.flags |= flags::NOT_LOADED;
        }
        if sample.flags & flags::NOT_LOADED == 0 && self.is_faded(&out.response) {
            sample.flags |= flags::OUTSIDE;
        }
        sample.energy = out.response.energy;
        sample.coverage = out.response.coverage;
        sample.evaluations = out.evaluations;
        self.workspace.device_wrench(&(out.wrench + damped))
    }
}
