//! The body of a hand without hardware: a mass on a spring-damper that is pulled to where the hand
//! wants to be and gives way to forces.

use fft_correlate::{Pose, Twist, Wrench};

use crate::device::contract::DeviceSpec;

/// Longest step of the body's own integration, seconds.
const STEP: f64 = 2.5e-4;

/// Longest time caught up in one poll, seconds.
const LONGEST_GAP: f64 = 1.0;

/// The hand and what it does. Lengths at the device.
#[derive(Debug, Clone, PartialEq)]
pub struct HandConfig {
    /// Moving mass of hand and handle, kg.
    pub mass: f64,
    /// Stiffness of a firm grip, N/m.
    pub stiffness: f64,
    /// Damping, N·s/m, kept when the hand lets go.
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

impl Default for HandConfig {
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

impl HandConfig {
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

/// Where a hand wants its handle, device frame, and how firmly: 1 is a firm grip, 0 none; stiffness
/// and strength are in proportion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pull {
    pub(crate) pose: Pose,
    pub(crate) grip: f64,
}

/// Mass and inertia of hand and handle, device frame.
#[derive(Debug)]
pub(crate) struct HandBody {
    pub(crate) pose: Pose,
    pub(crate) twist: Twist,
    /// What the device pushes with.
    pub(crate) wrench: Wrench,
    start: Option<f64>,
    time: f64,
}

impl HandBody {
    /// At rest.
    pub(crate) fn at(pose: Pose) -> Self {
        Self {
            pose,
            twist: Twist::default(),
            wrench: Wrench::ZERO,
            start: None,
            time: 0.0,
        }
    }

    /// Moves on to `now` on the loop's clock; `pull` says what the hand wants, at seconds since the
    /// first call.
    pub(crate) fn follow(&mut self, now: f64, hand: &HandConfig, pull: impl Fn(f64) -> Pull) {
        let start = *self.start.get_or_insert(now);
        let elapsed = (now - start - self.time).clamp(0.0, LONGEST_GAP);
        let steps = (elapsed / STEP).ceil();
        for _ in 0..steps as u32 {
            self.advance(elapsed / steps, hand, &pull(self.time));
        }
        self.time = self.time.max(now - start);
    }

    /// Is at a pose at `now`, whatever pulled.
    pub(crate) fn put(&mut self, now: f64, pose: Pose) {
        let start = *self.start.get_or_insert(now);
        self.time = self.time.max(now - start);
        self.pose = pose;
        self.twist = Twist::default();
    }

    fn advance(&mut self, dt: f64, c: &HandConfig, wanted: &Pull) {
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
