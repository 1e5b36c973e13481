//! Simulated operators: the body of an operator without hardware, a mass on a spring-damper that is
//! pulled to where the operator wants to be and gives way to forces; and a device that follows a
//! script.

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::device::script::{Geometry, Script};
use crate::device::workspace::Workspace;

/// Longest step of the body's own integration, seconds.
const STEP: f64 = 2.5e-4;

/// Longest time caught up in one poll, seconds.
const LONGEST_GAP: f64 = 1.0;

/// The operator and what it does. Lengths at the device.
///
/// See the example of [`SimulatedOperator`].
#[derive(Debug, Clone, PartialEq)]
pub struct OperatorConfig {
    /// Moving mass of hand and handle, kg.
    pub mass: f64,
    /// Stiffness of a firm grip, N/m.
    pub stiffness: f64,
    /// Damping, N·s/m, kept when the operator lets go.
    pub damping: f64,
    /// Moment of inertia, kg·m².
    pub inertia: f64,
    /// Rotational stiffness of a firm grip, N·m/rad.
    pub rotational_stiffness: f64,
    /// Rotational damping, N·m·s/rad.
    pub rotational_damping: f64,
    /// Greatest force with which a firm grip goes to where it wants to be, N.
    pub strength: f64,
    /// The same for torque, N·m.
    pub rotational_strength: f64,
    /// Root mean square per axis of the tremor of the wanted position, metres. Physiological
    /// tremor of 8-12 Hz is about 0.05-0.2 mm.
    pub tremor: f64,
    /// The same for the wanted rotation, radians.
    pub rotational_tremor: f64,
    /// Force with which the collision script pushes if nothing gives way, N.
    pub push: f64,
    /// Length of the script, seconds.
    pub duration: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for OperatorConfig {
    fn default() -> Self {
        Self {
            mass: 0.25,
            stiffness: 400.0,
            damping: 15.0,
            inertia: 3e-4,
            rotational_stiffness: 1.5,
            rotational_damping: 0.04,
            strength: f64::INFINITY,
            rotational_strength: f64::INFINITY,
            tremor: 1e-4,
            rotational_tremor: 2e-3,
            push: 3.0,
            duration: 10.0,
            seed: 1,
        }
    }
}

impl OperatorConfig {
    /// The device record: a 6-DOF desktop device of the better kind.
    pub fn spec(&self) -> DeviceSpec {
        DeviceSpec {
            name: "simulated hand".into(),
            input_dof: 6,
            output_dof: 6,
            rate_controlled: false,
            max_force: 10.0,
            max_torque: 1.0,
            max_stiffness: 3000.0,
            max_rotational_stiffness: 5.0,
            workspace: 0.4,
            nominal_rate: 1000.0,
        }
    }
}

/// Where an operator wants its handle, device frame, and how firmly: 1 is a firm grip, 0 none;
/// stiffness and strength are in proportion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    pub(crate) pose: Pose,
    pub(crate) grip: f64,
}

/// Mass and inertia of hand and handle, device frame.
#[derive(Debug)]
pub(crate) struct OperatorBody {
    pub(crate) pose: Pose,
    pub(crate) twist: Twist,
    /// What the device pushes with.
    pub(crate) wrench: Wrench,
    start: Option<f64>,
    time: f64,
}

impl OperatorBody {
    /// At rest.
    pub(crate) fn at_rest(pose: Pose) -> Self {
        Self {
            pose,
            twist: Twist::default(),
            wrench: Wrench::ZERO,
            start: None,
            time: 0.0,
        }
    }

    /// Moves on to `now` on the loop's clock; `pull` says what the operator wants, at seconds since
    /// the first call.
    pub(crate) fn follow(&mut self, now: f64, hand: &OperatorConfig, pull: impl Fn(f64) -> Target) {
        let start = *self.start.get_or_insert(now);
        let elapsed = (now - start - self.time).clamp(0.0, LONGEST_GAP);
        let steps = (elapsed / STEP).ceil();
        for _ in 0..steps as u32 {
            self.advance(elapsed / steps, hand, &pull(self.time));
        }
        self.time = self.time.max(now - start);
    }

    /// Is at a pose at `now`, whatever pulled.
    pub(crate) fn move_to(&mut self, now: f64, pose: Pose) {
        let start = *self.start.get_or_insert(now);
        self.time = self.time.max(now - start);
        self.pose = pose;
        self.twist = Twist::default();
    }

    fn advance(&mut self, dt: f64, c: &OperatorConfig, wanted: &Target) {
        let grip = wanted.grip;
        let pull = self.pose.twist_to(&wanted.pose);
        let spring = (pull.linear * c.stiffness).clamp_length_max(c.strength) * grip;
        let turn =
            (pull.angular * c.rotational_stiffness).clamp_length_max(c.rotational_strength) * grip;
        let force = spring - self.twist.linear * c.damping + self.wrench.force;
        let torque = turn - self.twist.angular * c.rotational_damping + self.wrench.torque;
        self.twist.linear += force * (dt / c.mass);
        self.twist.angular += torque * (dt / c.inertia);
        self.pose = self.pose.perturbed(&(self.twist * dt));
        self.time += dt;
    }
}

/// Sinusoids per axis that make the tremor.
const TREMORS: usize = 2;

#[derive(Debug, Clone, Copy)]
struct Tremor {
    rate: f64,
    phase: f64,
}

/// The simulated operator as a device.
///
/// ```
/// use fft_correlate::{Pose, Wrench};
/// use glam::DVec3;
/// use haptic::*;
///
/// let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
/// let (seated, axis) = (Pose::IDENTITY, -DVec3::Z);
/// let geometry = Geometry { seated, axis, depth: 0.03, radius: 0.01, tilt: 0.08 };
/// let config = OperatorConfig { duration: 2.0, ..OperatorConfig::default() };
/// let mut hand = SimulatedOperator::new(config, Script::Free, geometry, workspace);
/// let before = hand.poll(0.0)?.pose;
/// // A force of 5 N along x for 50 ms.
/// hand.send(&Wrench { force: DVec3::X * 5.0, ..Wrench::ZERO })?;
/// let after = hand.poll(0.05)?.pose;
/// assert!(after.translation.x - before.translation.x > 0.001);
/// # Ok::<(), DeviceError>(())
/// ```
#[derive(Debug)]
pub struct SimulatedOperator {
    spec: DeviceSpec,
    motion: ScriptedMotion,
    body: OperatorBody,
}

/// What the operator wants at a time.
#[derive(Debug)]
struct ScriptedMotion {
    config: OperatorConfig,
    script: Script,
    geometry: Geometry,
    workspace: Workspace,
    tremors: [[Tremor; TREMORS]; 6],
}

impl SimulatedOperator {
    /// An operator at rest where its script starts.
    pub fn new(
        config: OperatorConfig,
        script: Script,
        geometry: Geometry,
        workspace: Workspace,
    ) -> Self {
        let mut rng = SmallRng::seed_from_u64(config.seed);
        let tremors = std::array::from_fn(|_| {
            std::array::from_fn(|_| Tremor {
                rate: rng.random_range(8.0..12.0),
                phase: rng.random_range(0.0..std::f64::consts::TAU),
            })
        });
        let spec = config.spec();
        let motion = ScriptedMotion {
            config,
            script,
            geometry,
            workspace,
            tremors,
        };
        Self {
            spec,
            body: OperatorBody::at_rest(motion.target(0.0).0),
            motion,
        }
    }
}

impl ScriptedMotion {
    /// Wanted handle pose in the device's frame, without tremor, and grip strength.
    fn target(&self, time: f64) -> (Pose, f64) {
        let c = &self.config;
        let reach = c.push / c.stiffness * self.workspace.scale;
        let intent = self
            .script
            .intent(&self.geometry, time, c.duration, reach, c.seed);
        (self.workspace.device_pose(&intent.pose), intent.grip)
    }

    fn tremor(&self, time: f64) -> Twist {
        // A sum of n sinusoids of amplitude a has mean square n a²/2.
        let amplitude = (2.0 / TREMORS as f64).sqrt();
        let wave = |axis: usize| -> f64 {
            self.tremors[axis]
                .iter()
                .map(|t| (std::f64::consts::TAU * t.rate * time + t.phase).sin() * amplitude)
                .sum()
        };
        Twist {
            angular: DVec3::new(wave(0), wave(1), wave(2)) * self.config.rotational_tremor,
            linear: DVec3::new(wave(3), wave(4), wave(5)) * self.config.tremor,
        }
    }

    /// The pull at a time, tremor included.
    fn target_with_tremor(&self, time: f64) -> Target {
        let (pose, grip) = self.target(time);
        Target {
            pose: pose.perturbed(&self.tremor(time)),
            grip,
        }
    }
}

impl Device for SimulatedOperator {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let motion = &self.motion;
        self.body
            .follow(now, &motion.config, |time| motion.target_with_tremor(time));
        Ok(DeviceState {
            pose: self.body.pose,
            twist: self.body.twist,
            buttons: 0,
            timestamp: now,
        })
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.body.wrench = *wrench;
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.body.wrench = Wrench::ZERO;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn hand(config: OperatorConfig, script: Script) -> SimulatedOperator {
        let geometry = Geometry {
            seated: Pose::IDENTITY,
            axis: DVec3::NEG_Z,
            depth: 0.03,
            radius: 0.01,
            tilt: 0.05,
        };
        let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
        SimulatedOperator::new(config, script, geometry, workspace)
    }

    #[test]
    fn a_constant_force_bends_the_hand_by_its_compliance() {
        let config = OperatorConfig {
            tremor: 0.0,
            rotational_tremor: 0.0,
            push: 0.0,
            ..OperatorConfig::default()
        };
        let mut hand = hand(config, Script::Collision);
        hand.send(&Wrench {
            torque: DVec3::new(0.0, 0.03, 0.0),
            force: DVec3::new(2.0, 0.0, 0.0),
        })
        .unwrap();
        let mut state = hand.poll(0.0).unwrap();
        for tick in 1..2000 {
            state = hand.poll(tick as f64 * 1e-3).unwrap();
        }
        assert!((state.pose.translation.x - 2.0 / 400.0).abs() < 1e-9);
        assert!((state.pose.angle_to(&Pose::IDENTITY) - 0.03 / 1.5).abs() < 1e-6);
    }

    #[test]
    fn tremor_has_its_amplitude_and_band() {
        let hand = hand(OperatorConfig::default(), Script::Free);
        let n = 20_000;
        let values: Vec<f64> = (0..n)
            .map(|k| hand.motion.tremor(k as f64 * 1e-3).linear.x)
            .collect();
        let square: f64 = values.iter().map(|v| v * v).sum::<f64>() / n as f64;
        // 20 s of beating sinusoids: within 10 %.
        assert!((square.sqrt() / 1e-4 - 1.0).abs() < 0.1);
        let crossings = values
            .windows(2)
            .filter(|w| w[0] < 0.0 && w[1] >= 0.0)
            .count();
        let rate = crossings as f64 / 20.0;
        assert!((8.0..=12.0).contains(&rate), "{rate}");
    }

    #[test]
    fn passes_the_conformance_suite() {
        let mut hand = hand(OperatorConfig::default(), Script::Free);
        crate::device::conformance::check(&mut hand).unwrap();
    }

    #[test]
    fn the_same_seed_moves_the_same_way() {
        let run = || {
            let mut hand = hand(OperatorConfig::default(), Script::Snap);
            (0..3000)
                .map(|k| hand.poll(k as f64 * 1e-3).unwrap())
                .next_back()
        };
        assert_eq!(run(), run());
    }
}
