//! The virtual object and the spring-damper between it and the device.
//!
//! The force on the handle is the coupling's, never the field's own: at most `stiffness` newtons
//! per metre however steep the field. While the spring can hold the object in a kink, the handle
//! feels the spring about the kink; the force has no jump. Without rounding and with the field
//! evaluated often enough, it is the gradient of the energy's Moreau envelope, so no energy comes
//! from nowhere.

use fft_correlate::{Pose, Response, Twist, Wrench};

use crate::config::CouplingConfig;
use crate::config::HapticConfig;
use crate::device::contract::DeviceSpec;
use crate::path::bundle::Bundle;
use crate::path::metric::{Metric, Six};

/// Joules by which the model may be wrong at the object before the field is asked again within the
/// same tick: 4 µm or 4 mN at 1 kN/m.
const GOOD_MODEL: f64 = 1e-8;

/// Time constant of the damper's velocity, seconds.
const DAMPER_FILTER: f64 = 0.003;

/// Stiffness and damping, N/m, N·s/m and their rotational counterparts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// N/m.
    pub stiffness: f64,
    /// N·m/rad.
    pub rotational_stiffness: f64,
    /// N·s/m.
    pub damping: f64,
    /// N·m·s/rad.
    pub rotational_damping: f64,
}

impl Gains {
    /// What the device is passive with at the configured rate.
    ///
    /// A sampled spring-damper with hold is passive if `b > K T / 2 + B` (Colgate and Schenkel
    /// 1997), `b` the device's own damping, `T` the period. A maker states not `b` but the
    /// stiffest wall at a rate, which gives `b = K_max / (2 rate)`. Stiffness is served first,
    /// damping takes what is left.
    pub fn passive(spec: &DeviceSpec, config: &HapticConfig) -> Self {
        let c = &config.coupling;
        let (stiffness, damping) = passive_pair(
            c.stiffness,
            c.damping,
            spec.max_stiffness / (2.0 * spec.nominal_rate),
            config.period(),
        );
        let (rotational_stiffness, rotational_damping) = passive_pair(
            c.rotational_stiffness,
            c.rotational_damping,
            spec.max_rotational_stiffness / (2.0 * spec.nominal_rate),
            config.period(),
        );
        Self {
            stiffness,
            rotational_stiffness,
            damping,
            rotational_damping,
        }
    }
}

fn passive_pair(stiffness: f64, damping: f64, device_damping: f64, period: f64) -> (f64, f64) {
    let stiffness = stiffness.min(2.0 * device_damping / period);
    let left = (device_damping - stiffness * period / 2.0).max(0.0);
    (stiffness, damping.min(left))
}

/// State of the virtual object. Poses are grip poses in the scene, wrenches act at the grip.
#[derive(Debug, Clone)]
pub struct Coupling {
    gains: Gains,
    limits: SpringLimits,
    speed: f64,
    angular_speed: f64,
    evaluations: u32,
    metric: Metric,
    bundle: Bundle,
    object: Option<Pose>,
    stretch: Twist,
    stretch_rate: Twist,
}

/// Force and torque, N and N·m, beyond which the springs count as yielding in the energy balance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringLimits {
    /// N.
    pub force: f64,
    /// N·m.
    pub torque: f64,
}

/// One tick's result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CouplingStep {
    /// On the handle, about the grip, scene frame.
    pub wrench: Wrench,
    /// Grip pose of the virtual object.
    pub object: Pose,
    /// The field's last answer, at or within a step of `object`, wrench about the grip.
    pub response: Response,
    /// Energy held by field and springs, joules.
    pub potential: f64,
    /// Times the field was asked.
    pub evaluations: u32,
    /// An answer was not finite and was left out.
    pub bad_source: bool,
}

impl Coupling {
    /// `gains` and `limits` are the device's; `scale` is scene metres per device metre.
    pub fn new(
        gains: Gains,
        limits: SpringLimits,
        config: &CouplingConfig,
        lock_rotation: bool,
        scale: f64,
    ) -> Self {
        // The same energy for the same device motion.
        let stiffness = gains.stiffness / (scale * scale);
        let gains = Gains {
            stiffness,
            damping: gains.damping / (scale * scale),
            ..gains
        };
        let limits = SpringLimits {
            force: limits.force / scale,
            ..limits
        };
        let metric = Metric::new(gains.rotational_stiffness, stiffness, lock_rotation);
        Self {
            gains,
            limits,
            speed: config.max_speed * scale,
            angular_speed: config.max_angular_speed,
            evaluations: config.evaluations,
            metric,
            bundle: Bundle::new(metric),
            object: None,
            stretch: Twist::default(),
            stretch_rate: Twist::default(),
        }
    }

    /// Forgets the object: the next step starts with it at the device.
    pub fn release(&mut self) {
        self.object = None;
        self.bundle.clear();
        self.stretch = Twist::default();
        self.stretch_rate = Twist::default();
    }

    /// The object's grip pose; `None` before the first step.
    pub fn object(&self) -> Option<Pose> {
        self.object
    }

    /// Forgets what is known of the field, which has become another; the object stays.
    pub fn forget_field(&mut self) {
        self.bundle.clear();
    }

    /// Moves the object for a device at `device` and gives the force on the handle. `field` is
    /// asked between once and `evaluations` times; `dt` is in seconds.
    pub fn step(
        &mut self,
        device: &Pose,
        dt: f64,
        mut field: impl FnMut(&Pose) -> Response,
    ) -> CouplingStep {
        let start = self.object.unwrap_or(*device);
        let from = self.metric.scaled(&device.twist_to(&start));
        self.bundle.rebase(device);
        let mut response = Response::default();
        let mut asked = 0;
        let mut bad_source = false;
        while asked < self.evaluations {
            // Where nothing is known the field is asked where the object is.
            let y = match self.bundle.is_empty() {
                true => from,
                false => self.reach(&from, dt),
            };
            let at = self.pose(device, &y);
            let answer = field(&at);
            asked += 1;
            if !(answer.energy.is_finite() && answer.wrench.is_finite()) {
                bad_source = true;
                break;
            }
            response = answer;
            let miss = answer.energy - self.bundle.value(&y);
            self.bundle.add(at, y, answer.energy, &answer.wrench);
            if miss.abs() < GOOD_MODEL {
                break;
            }
        }
        let y = self.reach(&from, dt);
        self.object = Some(self.pose(device, &y));
        self.feel(device, &y, dt, response, asked, bad_source)
    }

    /// The model's rest point, no farther from `from` than the object's speed allows.
    fn reach(&mut self, from: &Six, dt: f64) -> Six {
        let wanted = self.bundle.proximal_point();
        let step: Six = std::array::from_fn(|i| wanted[i] - from[i]);
        let twist = self.metric.twist(&step);
        let ratio = |length: f64, limit: f64| if length > limit { limit / length } else { 1.0 };
        let angular = if self.metric.locks_rotation() {
            1.0
        } else {
            ratio(twist.angular.length(), self.angular_speed * dt)
        };
        let share = ratio(twist.linear.length(), self.speed * dt).min(angular);
        std::array::from_fn(|i| from[i] + share * step[i])
    }

    fn pose(&self, device: &Pose, y: &Six) -> Pose {
        let mut twist = self.metric.twist(y);
        if self.metric.locks_rotation() {
            twist.angular = glam::DVec3::ZERO;
        }
        device.perturbed(&twist)
    }

    fn feel(
        &mut self,
        device: &Pose,
        y: &Six,
        dt: f64,
        response: Response,
        evaluations: u32,
        bad_source: bool,
    ) -> CouplingStep {
        let stretch = self.metric.twist(y);
        if dt > 0.0 {
            let rate = (stretch - self.stretch) * (1.0 / dt);
            let share = dt / (dt + DAMPER_FILTER);
            self.stretch_rate = self.stretch_rate * (1.0 - share) + rate * share;
        }
        self.stretch = stretch;
        let g = &self.gains;
        let wrench = Wrench {
            torque: stretch.angular * g.rotational_stiffness
                + self.stretch_rate.angular * g.rotational_damping,
            force: stretch.linear * g.stiffness + self.stretch_rate.linear * g.damping,
        };
        let model = self.bundle.value(y);
        let springs = yielding(stretch.linear.length(), g.stiffness, self.limits.force)
            + yielding(
                stretch.angular.length(),
                g.rotational_stiffness,
                self.limits.torque,
            );
        CouplingStep {
            wrench,
            object: self.object.unwrap_or(*device),
            response,
            potential: if model.is_finite() { model } else { 0.0 } + springs,
            evaluations,
            bad_source,
        }
    }
}

/// Energy of a spring whose force stops growing at `limit`.
fn yielding(stretch: f64, stiffness: f64, limit: f64) -> f64 {
    let reach = limit / stiffness;
    if stretch <= reach {
        0.5 * stiffness * stretch * stretch
    } else {
        limit * (stretch - 0.5 * reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn coupling() -> Coupling {
        let config = HapticConfig::default();
        let gains = Gains {
            stiffness: 1000.0,
            rotational_stiffness: 1.0,
            damping: 0.0,
            rotational_damping: 0.0,
        };
        let limits = SpringLimits {
            force: 5.0,
            torque: 0.3,
        };
        Coupling::new(gains, limits, &config.coupling, false, 1.0)
    }

    /// A plane wall of slope `s` newtons at `x = 0`, free below.
    fn wall(pose: &Pose, s: f64) -> Response {
        let inside = pose.translation.x > 0.0;
        Response {
            energy: if inside { s * pose.translation.x } else { 0.0 },
            wrench: Wrench {
                force: DVec3::new(if inside { -s } else { 0.0 }, 0.0, 0.0),
                ..Wrench::ZERO
            },
            coverage: 1.0,
        }
    }

    #[test]
    fn free_space_has_no_force() {
        let mut coupling = coupling();
        let device = Pose::from_translation(DVec3::new(-0.01, 0.02, 0.0));
        let out = coupling.step(&device, 0.001, |p| wall(p, 4.0));
        assert_eq!(out.wrench, Wrench::ZERO);
        assert_eq!(out.object, device);
    }

    #[test]
    fn a_wall_is_felt_as_the_coupling_spring_until_it_gives_way() {
        // Slope 4 N: up to 4 mm deep the object stays on the wall, then it goes through.
        let mut coupling = coupling();
        let mut worst: f64 = 0.0;
        for tick in 0..80 {
            let depth = tick as f64 * 1e-4 - 1e-3;
            let device = Pose::from_translation(DVec3::new(depth, 0.0, 0.0));
            let out = coupling.step(&device, 0.001, |p| wall(p, 4.0));
            let expected = -(1000.0 * depth).clamp(0.0, 4.0);
            worst = worst.max((out.wrench.force.x - expected).abs());
        }
        // The object's error of GOOD_MODEL is 4 mN.
        assert!(worst < 0.005, "{worst}");
    }

    #[test]
    fn the_object_is_no_faster_than_allowed() {
        let mut coupling = coupling();
        coupling.step(&Pose::IDENTITY, 0.001, |p| wall(p, 0.0));
        let far = Pose::from_translation(DVec3::new(0.0, 1.0, 0.0));
        let out = coupling.step(&far, 0.001, |p| wall(p, 0.0));
        assert!((out.object.translation.y - 0.002).abs() < 1e-12);
    }

    #[test]
    fn stiffness_and_damping_obey_the_sampled_passivity_bound() {
        let spec = DeviceSpec {
            max_stiffness: 1500.0,
            nominal_rate: 1000.0,
            ..crate::device::simulated::OperatorConfig::default().spec()
        };
        for rate_hz in [200.0, 500.0, 1000.0, 4000.0] {
            for stiffness in [100.0, 1000.0, 1e5] {
                let mut config = HapticConfig {
                    rate_hz,
                    ..HapticConfig::default()
                };
                config.coupling.stiffness = stiffness;
                let g = Gains::passive(&spec, &config);
                let own = 1500.0 / 2000.0;
                assert!(g.stiffness / rate_hz / 2.0 + g.damping <= own + 1e-12);
                assert!(g.stiffness <= stiffness && g.stiffness > 0.0);
            }
        }
    }

    #[test]
    fn scaling_lengths_changes_nothing_at_the_device() {
        let config = HapticConfig::default();
        let mut forces = Vec::new();
        for scale in [1.0, 0.1] {
            let gains = Gains::passive(
                &crate::device::simulated::OperatorConfig::default().spec(),
                &config,
            );
            let limits = SpringLimits {
                force: 5.0,
                torque: 0.3,
            };
            let mut coupling = Coupling::new(gains, limits, &config.coupling, false, scale);
            let mut last = 0.0;
            for tick in 0..30 {
                let depth = tick as f64 * 1e-4 * scale;
                let device = Pose::from_translation(DVec3::new(depth, 0.0, 0.0));
                let out = coupling.step(&device, 0.001, |p| wall(p, 4.0 / scale));
                last = out.wrench.force.x * scale;
            }
            forces.push(last);
        }
        assert!((forces[0] - forces[1]).abs() < 1e-2, "{forces:?}");
    }
}
