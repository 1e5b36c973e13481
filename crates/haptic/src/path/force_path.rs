//! One tick of the force path: input to wrench, without clock, thread or allocation.

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};

use crate::config::ConfigError;
use crate::config::HapticConfig;
use crate::device::contract::{DeviceSpec, DeviceState};
use crate::device::workspace::Workspace;
use crate::path::coupling::{Coupling, Gains, SpringLimits};
use crate::path::gate::Gate;
use crate::path::joint_guide::{GuidedJoint, JointGuide, guides};
use crate::path::limiter::Limiter;
use crate::path::passivity::{EnergyAccount, Passivity};
use crate::path::sample::{Sample, flags};

/// Share of the force and torque limits below which nothing is felt: an exchanged source may change
/// the wrench by so much without the force being let go.
const KNOCK: f64 = 0.02;

/// Joules by which an exchanged source may differ at the object and still be the same field there.
const SAME_ENERGY: f64 = 1e-8;

/// Gate, coupling, field, passivity and limits in a row, with their state.
///
/// ```
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::*;
///
/// let config = HapticConfig { ramp_s: 0.0, ..HapticConfig::default() };
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let source = SumSource::new(DVec3::ZERO, vec![]); // free space
/// let spec = OperatorConfig::default().spec();
/// # use fft_correlate::EnergySource;
/// let mut path = ForcePath::new(&spec, &config, workspace, source.scratch())?;
/// // No force in free space; the object follows the handle.
/// let handle = DeviceState::at_rest(Pose::from_translation(DVec3::X * 0.001), 0.0);
/// let sample = path.step(&source, Some(&handle), 0.0, config.period());
/// assert_eq!((sample.tick, sample.wrench.force.length()), (0, 0.0));
/// assert!((sample.object.translation.x - 0.001).abs() < 1e-9);
/// assert_eq!(path.account().work_in(), 0.0);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug)]
pub struct ForcePath {
    workspace: Workspace,
    gains: Gains,
    gate: Gate,
    coupling: Coupling,
    passivity: Passivity,
    limiter: Limiter,
    guides: Vec<JointGuide>,
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
            guides: Vec::new(),
            scratch,
            held: Wrench::ZERO,
            ticks: 0,
        })
    }

    /// Keeps the part on the free motions of a joint, in whichever of some places that are alike it is,
    /// by springs as stiff as the coupling's whose force stays within the limit; beyond, they give way.
    #[must_use]
    pub fn guided(mut self, joints: &[GuidedJoint]) -> Self {
        let scale = self.workspace.scale;
        let stiffness = self.gains.stiffness / (scale * scale);
        let force = self.limiter.max_force() / scale;
        self.guides = guides(joints, [stiffness, self.gains.rotational_stiffness, force]);
        self
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
        let (workspace, scratch, guides) = (&self.workspace, &mut self.scratch, &self.guides);
        let out = self.coupling.step(&grip, dt, |at| {
            let part = workspace.part_pose(at);
            let mut answer = source.evaluate(&part, scratch);
            for guide in guides {
                let (energy, wrench) = guide.respond(&part);
                answer.energy += energy;
                answer.wrench += wrench;
            }
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

#[cfg(test)]
mod tests {
    use fft_correlate::mating::JointKind;
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::device::simulated::OperatorConfig;

    struct Nothing;

    impl EnergySource for Nothing {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, _: &Pose, _: &mut Scratch) -> Response {
            Response {
                coverage: 1.0,
                ..Response::default()
            }
        }
    }

    /// A hand that pulls a slider along its guide moves it; one that pulls it aside, or turns it,
    /// hardly does and feels it.
    #[test]
    fn a_guided_part_follows_its_joint() {
        let spec = OperatorConfig::default().spec();
        let config = HapticConfig {
            ramp_s: 0.0,
            ..HapticConfig::default()
        };
        let joint = GuidedJoint {
            kind: JointKind::Prismatic,
            axis: DVec3::Z,
            point: DVec3::ZERO,
            pitch: 0.0,
            pose: Pose::IDENTITY,
        };
        // The object and the force after some time with the hand there.
        let held = |at: Pose, joints: &[GuidedJoint]| {
            let path = ForcePath::new(
                &spec,
                &config,
                Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO),
                Nothing.scratch(),
            );
            let mut path = path.unwrap().guided(joints);
            let mut last = Sample::default();
            for tick in 0..2000 {
                let now = f64::from(tick) * 1e-3;
                let share = (now / 0.5).min(1.0);
                let rotation = DQuat::IDENTITY.slerp(at.rotation, share);
                let there = Pose::new(rotation, share * at.translation);
                let input = DeviceState::at_rest(there, now);
                last = path.step(&Nothing, Some(&input), now, 1e-3);
            }
            (last.object, last.wrench)
        };
        let along = Pose::from_translation(0.02 * DVec3::Z);
        let (object, wrench) = held(along, &[joint]);
        assert!((object.translation.z - 0.02).abs() < 1e-5 && wrench.force.length() < 0.01);
        let turn = DQuat::from_rotation_z(0.1);
        let aside = Pose::new(turn, DVec3::new(0.002, 0.0, 0.01));
        let (object, wrench) = held(aside, &[joint]);
        assert!(object.translation.x < 0.0004, "{object:?}");
        assert!(object.angle_to(&Pose::IDENTITY) < 0.02, "{object:?}");
        assert!(
            wrench.force.x < -1.0 && wrench.torque.z < -0.03,
            "{wrench:?}"
        );
        let (object, _) = held(aside, &[]);
        assert!((object.translation.x - 0.002).abs() < 1e-9, "{object:?}");
    }
}
