//! Time-domain passivity: counts the energy at the device's port and damps what is too much.
//!
//! Between two polls the device moves by a small twist while the last wrench is held, so the work
//! of the operator on the loop is exactly `-wrench · twist`. What the field and the springs hold is
//! known too (the wrench is a gradient), so the *balance*
//!
//! ```text
//! balance += work in - change of stored energy
//! ```
//!
//! should never fall: a fall is energy made by sampling, lag or limits. Below zero the controller
//! adds the damping that takes the deficit back within one tick, up to a limit (Hannaford and Ryu
//! 2002; with the stored energy as reference, Ryu et al. 2005). What was dissipated long ago does
//! not excuse activity now: the balance is credited with `credit` joules at most.

use fft_correlate::{Pose, Twist, Wrench};

use crate::config::PassivityConfig;

/// Observer and controller. Everything is at the grip, scene frame.
#[derive(Debug, Clone)]
pub struct Passivity {
    control: bool,
    credit: f64,
    max_damping: f64,
    angular_share: f64,
    last: Option<(Pose, f64)>,
    balance: f64,
    velocity: Twist,
    work_force: f64,
    work_torque: f64,
    made: f64,
    taken: f64,
    exchanged: f64,
}

/// Energy bookkeeping over a run, joules.
///
/// See the example of [`ForcePath`](crate::ForcePath).
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct EnergyAccount {
    /// Net work of the operator on the loop through the force.
    pub work_force: f64,
    /// Net work of the operator on the loop through the torque. Only the sum of both is kept
    /// passive: a field may turn the part with what its translation cost, and give it back.
    pub work_torque: f64,
    /// Sum of all falls of the balance: energy made by sampling and lag.
    pub made: f64,
    /// Dissipated by the controller.
    pub taken: f64,
    /// The balance now; at most the credit.
    pub balance: f64,
    /// What exchanged energy sources held more than those before them, at the strength then shown.
    pub exchanged: f64,
}

impl EnergyAccount {
    /// Net work of the operator on the loop.
    pub fn work_in(&self) -> f64 {
        self.work_force + self.work_torque
    }
}

impl Passivity {
    /// `angular_share` is the ratio of angular to linear damping, m²/rad²; `scale` is scene metres
    /// per device metre.
    pub fn new(config: &PassivityConfig, angular_share: f64, scale: f64) -> Self {
        Self {
            control: config.control,
            credit: config.credit,
            max_damping: config.max_damping / (scale * scale),
            angular_share: angular_share * scale * scale,
            last: None,
            balance: config.credit,
            velocity: Twist::default(),
            work_force: 0.0,
            work_torque: 0.0,
            made: 0.0,
            taken: 0.0,
            exchanged: 0.0,
        }
    }

    /// Starts counting anew from the next observation; the account goes on.
    pub fn rebase(&mut self) {
        self.last = None;
        self.velocity = Twist::default();
    }

    /// The field became another that holds `energy` joules more where the object is, shown with
    /// strength `gain`. That is nobody's work: it is kept out of the balance.
    pub fn exchange(&mut self, energy: f64, gain: f64) {
        if !energy.is_finite() {
            return;
        }
        if let Some((_, stored)) = &mut self.last {
            *stored += energy;
            self.exchanged += gain * energy;
        }
    }

    /// Counts the time since the last observation, in which `held` acted on the handle while it
    /// moved to `device`, and the stored energy, shown with strength `gain`, became `potential`.
    pub fn observe(&mut self, device: &Pose, potential: f64, gain: f64, held: &Wrench, dt: f64) {
        if let Some((before, stored)) = self.last {
            let moved = before.twist_to(device);
            let work_force = -held.force.dot(moved.linear);
            let work_torque = -held.torque.dot(moved.angular);
            let work = work_force + work_torque;
            let change = work - gain * (potential - stored);
            self.work_force += work_force;
            self.work_torque += work_torque;
            self.made += (-change).max(0.0);
            self.balance = (self.balance + change).min(self.credit);
            self.velocity = if dt > 0.0 {
                moved * (1.0 / dt)
            } else {
                Twist::default()
            };
        }
        self.last = Some((*device, potential));
    }

    /// The controller's wrench for the next `dt` seconds: nothing while the balance is positive.
    pub fn control(&mut self, dt: f64) -> Wrench {
        let v = self.velocity;
        let square = v.linear.length_squared() + self.angular_share * v.angular.length_squared();
        if !self.control || self.balance >= 0.0 || square <= 0.0 || dt <= 0.0 {
            return Wrench::ZERO;
        }
        let damping = (-self.balance / (square * dt)).min(self.max_damping);
        self.taken += damping * square * dt;
        Wrench {
            torque: v.angular * (-damping * self.angular_share),
            force: v.linear * -damping,
        }
    }

    /// The bookkeeping so far.
    pub fn account(&self) -> EnergyAccount {
        EnergyAccount {
            work_force: self.work_force,
            work_torque: self.work_torque,
            made: self.made,
            taken: self.taken,
            balance: self.balance,
            exchanged: self.exchanged,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn at(x: f64) -> Pose {
        Pose::from_translation(DVec3::new(x, 0.0, 0.0))
    }

    /// A spring of stiffness 1000 N/m shown with one tick of lag to a device that swings: it makes
    /// energy, by about `π K A² sin(ω T)` per period.
    fn swing(control: bool) -> (Passivity, f64) {
        let config = PassivityConfig {
            control,
            credit: 0.0,
            max_damping: 100.0,
        };
        let mut passivity = Passivity::new(&config, 1e-3, 1.0);
        let (dt, amplitude, omega) = (0.001, 0.005, 2.0 * std::f64::consts::PI * 5.0);
        let mut held = Wrench::ZERO;
        for tick in 0..1000 {
            let x = amplitude * (omega * tick as f64 * dt).sin();
            passivity.observe(&at(x), 500.0 * x * x, 1.0, &held, dt);
            held = passivity.control(dt);
            held.force.x -= 1000.0 * x;
        }
        let per_period =
            std::f64::consts::PI * 1000.0 * amplitude.powi(2) * (omega * dt / 2.0).sin();
        (passivity, 5.0 * per_period)
    }

    #[test]
    fn the_observer_counts_what_sampling_makes() {
        let (passivity, expected) = swing(false);
        let account = passivity.account();
        // The hold lags by half a tick; second order in ωT.
        let seen = -account.balance;
        assert!((seen / expected - 1.0).abs() < 0.02, "{seen} {expected}");
    }

    #[test]
    fn the_controller_takes_it_back() {
        let (passivity, expected) = swing(true);
        assert!(passivity.account().taken > 0.5 * expected);
        assert!(passivity.account().balance > -0.01 * expected);
    }

    #[test]
    fn old_dissipation_is_credited_only_so_far() {
        let config = PassivityConfig {
            control: true,
            credit: 0.5,
            max_damping: 1.0,
        };
        let mut passivity = Passivity::new(&config, 1e-3, 1.0);
        let drag = Wrench {
            force: DVec3::new(-10.0, 0.0, 0.0),
            ..Wrench::ZERO
        };
        passivity.observe(&at(0.0), 0.0, 1.0, &drag, 0.001);
        passivity.observe(&at(1.0), 0.0, 1.0, &drag, 0.001);
        assert_eq!(passivity.account().balance, 0.5);
        assert!((passivity.account().work_in() - 10.0).abs() < 1e-12);
    }
}
