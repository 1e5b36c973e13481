//! Judges every input before it moves anything, and how strongly the force may be shown.

use fft_correlate::Pose;

use crate::config::HapticConfig;
use crate::device::contract::DeviceState;
use crate::path::sample::flags;

/// Ticks that a new place must hold after a jump before it is believed.
const JUMP_TICKS: u32 = 50;

/// Non-unit quaternions within this are normalized, beyond it refused.
const UNIT_TOLERANCE: f64 = 1e-3;

/// What the gate made of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateDecision {
    /// The pose to use: this input's, or the last good one; `None` before the first.
    pub pose: Option<Pose>,
    /// The pose has nothing to do with the last one: start from it anew.
    pub reseat: bool,
    /// Strength of the force, 0 ..= 1.
    pub gain: f64,
    /// Faults of this tick, bits of [`crate::flags`].
    pub flags: u16,
}

/// State of the judgement: last good pose, strength, faults in a row.
#[derive(Debug, Clone)]
pub struct Gate {
    period: f64,
    ramp: f64,
    decay: f64,
    stale: f64,
    late: f64,
    speed: f64,
    angular_speed: f64,
    senses_rotation: bool,
    pose: Option<Pose>,
    jumped_to: Option<Pose>,
    jump_ticks: u32,
    stamp: f64,
    gain: f64,
    gone: bool,
    fault_later: bool,
}

impl Gate {
    /// `senses_rotation`: whether the device's rotation means anything.
    pub fn new(config: &HapticConfig, senses_rotation: bool) -> Self {
        Self {
            period: config.period(),
            ramp: config.ramp_s,
            decay: config.decay_s,
            stale: config.stale_s,
            late: f64::from(config.missed_ticks) * config.period(),
            speed: config.limits.device_speed,
            angular_speed: config.limits.device_angular_speed,
            senses_rotation,
            pose: None,
            jumped_to: None,
            jump_ticks: 0,
            stamp: 0.0,
            gain: 0.0,
            gone: false,
            fault_later: false,
        }
    }

    /// Judges the input at `now`, `dt` seconds after the last tick.
    ///
    /// A missing, invalid, stale or jumping input, or a late tick, lets the force go with the decay
    /// time constant, at the last good pose; good input raises it again over the ramp.
    pub fn admit(&mut self, input: Option<&DeviceState>, now: f64, dt: f64) -> GateDecision {
        let mut reseat = false;
        let mut flags = if dt > self.late { flags::LATE } else { 0 };
        match input.map(|state| (state, self.clean(state))) {
            None => {
                flags |= flags::NO_INPUT;
                self.gone = true;
            }
            Some((_, None)) => flags |= flags::BAD_INPUT,
            Some((state, Some(pose))) => {
                // A stamp from the future says as little as an old one.
                let fresh = (now - state.timestamp).abs() <= self.stale;
                if !fresh {
                    flags |= flags::STALE;
                }
                let (jump, seat) = self.follow(pose, state.timestamp);
                reseat = seat;
                if jump {
                    flags |= flags::JUMP;
                }
            }
        }
        let fault = flags != 0 || std::mem::take(&mut self.fault_later);
        self.strengthen(fault, reseat, dt);
        GateDecision {
            pose: self.pose,
            reseat,
            gain: self.gain,
            flags,
        }
    }

    /// A valid pose with a unit quaternion, or nothing.
    fn clean(&self, state: &DeviceState) -> Option<Pose> {
        let pose = &state.pose;
        let rotation = if self.senses_rotation {
            pose.rotation
        } else {
            glam::DQuat::IDENTITY
        };
        let good = pose.translation.is_finite()
            && pose.translation.abs().max_element() < 1e6
            && rotation.is_finite()
            && (rotation.length() - 1.0).abs() < UNIT_TOLERANCE
            && state.timestamp.is_finite();
        good.then(|| Pose::new(rotation, pose.translation))
    }

    /// Takes the pose over unless it is a jump; gives (jump, reseat).
    fn follow(&mut self, pose: Pose, stamp: f64) -> (bool, bool) {
        // Between two measurements a hand moves so far, however often the loop asks.
        let elapsed = (stamp - self.stamp).clamp(self.period, self.stale);
        self.stamp = stamp;
        let Some(last) = self.pose.filter(|_| !self.gone) else {
            self.gone = false;
            self.pose = Some(pose);
            return (false, true);
        };
        if self.is_near(&last, &pose, elapsed) {
            self.pose = Some(pose);
            self.jumped_to = None;
            return (false, false);
        }
        let steady = self
            .jumped_to
            .is_some_and(|j| self.is_near(&j, &pose, elapsed));
        self.jump_ticks = if steady { self.jump_ticks + 1 } else { 0 };
        self.jumped_to = Some(pose);
        if self.jump_ticks < JUMP_TICKS {
            return (true, false);
        }
        self.jumped_to = None;
        self.pose = Some(pose);
        (true, true)
    }

    fn is_near(&self, a: &Pose, b: &Pose, elapsed: f64) -> bool {
        let twist = a.twist_to(b);
        twist.linear.length() <= self.speed * elapsed
            && twist.angular.length() <= self.angular_speed * elapsed
    }

    fn strengthen(&mut self, fault: bool, reseat: bool, dt: f64) {
        if reseat || self.pose.is_none() {
            self.gain = 0.0;
        } else if fault {
            self.gain *= (-dt.max(0.0) / self.decay).exp();
            if self.gain < 1e-6 {
                self.gain = 0.0;
            }
        } else if self.ramp > 0.0 {
            let dt = dt.clamp(0.0, 2.0 * self.period);
            self.gain = (self.gain + dt / self.ramp).min(1.0);
        } else {
            self.gain = 1.0;
        }
    }

    /// Begins the ramp again from no force.
    pub fn restart(&mut self) {
        self.gain = 0.0;
    }

    /// Lets the force go in the next tick for a fault found later in this one.
    pub fn record_fault(&mut self) {
        self.fault_later = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    const DT: f64 = 0.001;

    fn gate() -> Gate {
        Gate::new(&HapticConfig::default(), true)
    }

    fn run(gate: &mut Gate, state: Option<&DeviceState>, ticks: u32) -> GateDecision {
        let mut out = gate.admit(state, 0.0, DT);
        for _ in 1..ticks {
            out = gate.admit(state, 0.0, DT);
        }
        out
    }

    fn still(x: f64) -> DeviceState {
        DeviceState::at_rest(Pose::from_translation(DVec3::new(x, 0.0, 0.0)), 0.0)
    }

    #[test]
    fn the_force_ramps_up_and_is_let_go_when_input_is_missing() {
        let mut gate = gate();
        assert_eq!(run(&mut gate, Some(&still(0.0)), 1).gain, 0.0);
        let half = run(&mut gate, Some(&still(0.0)), 250).gain;
        assert!((half - 0.5).abs() < 1e-9);
        assert_eq!(run(&mut gate, Some(&still(0.0)), 300).gain, 1.0);
        let out = run(&mut gate, None, 100);
        assert!(out.gain < 1e-4 && out.flags == flags::NO_INPUT);
        let back = run(&mut gate, Some(&still(0.05)), 1);
        assert!(back.reseat && back.gain == 0.0);
    }

    #[test]
    fn a_jump_is_held_back_until_it_stays() {
        let mut gate = gate();
        run(&mut gate, Some(&still(0.0)), 1000);
        let out = gate.admit(Some(&still(0.1)), 0.0, DT);
        assert_eq!(out.flags, flags::JUMP);
        assert_eq!(out.pose.unwrap().translation.x, 0.0);
        let out = run(&mut gate, Some(&still(0.1)), JUMP_TICKS);
        assert!(out.reseat && out.gain == 0.0);
        assert_eq!(out.pose.unwrap().translation.x, 0.1);
    }

    #[test]
    fn the_two_signs_of_a_quaternion_are_one_rotation() {
        let mut gate = gate();
        let q = DQuat::from_rotation_z(0.3);
        for tick in 0..100 {
            let rotation = if tick % 2 == 0 { q } else { -q };
            let pose = Pose {
                rotation,
                translation: DVec3::ZERO,
            };
            let out = gate.admit(Some(&DeviceState::at_rest(pose, 0.0)), 0.0, DT);
            assert_eq!(out.flags, 0);
        }
    }

    #[test]
    fn bad_numbers_and_old_stamps_are_faults() {
        let mut gate = gate();
        run(&mut gate, Some(&still(0.0)), 10);
        let mut bad = still(f64::NAN);
        assert_eq!(run(&mut gate, Some(&bad), 1).flags, flags::BAD_INPUT);
        bad = still(0.0);
        bad.pose.rotation = DQuat::from_xyzw(0.0, 0.0, 0.0, 1.01);
        assert_eq!(run(&mut gate, Some(&bad), 1).flags, flags::BAD_INPUT);
        bad = still(0.0);
        bad.timestamp = -1.0;
        assert_eq!(run(&mut gate, Some(&bad), 1).flags, flags::STALE);
        assert_eq!(gate.admit(Some(&still(0.0)), 0.0, 0.05).flags, flags::LATE);
    }
}
