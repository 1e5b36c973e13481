//! The last stage before the device: nothing beyond its limits ever leaves.

use fft_correlate::Wrench;
use glam::DVec3;

use crate::config::HapticConfig;
use crate::device::contract::DeviceSpec;

/// Limits the magnitude and the rate of change of a wrench; one that is not finite becomes zero.
///
/// ```
/// use fft_correlate::Wrench;
/// use glam::DVec3;
/// use haptic::{HapticConfig, Limiter, OperatorConfig};
///
/// let mut limiter = Limiter::new(&OperatorConfig::default().spec(), &HapticConfig::default());
/// let wanted = Wrench { force: DVec3::X * 100.0, ..Wrench::ZERO };
/// // At 2000 N/s the force reaches 2 N in the first millisecond; 5 N is the limit.
/// let (first, did) = limiter.limit(&wanted, 1.0, 1e-3);
/// assert!(did.slewed && (first.force.x - 2.0).abs() < 1e-9);
/// for _ in 0..10 {
///     limiter.limit(&wanted, 1.0, 1e-3);
/// }
/// assert!((limiter.limit(&wanted, 1.0, 1e-3).0.force.x - limiter.max_force()).abs() < 1e-9);
/// assert_eq!(limiter.max_force(), 5.0);
/// ```
#[derive(Debug, Clone)]
pub struct Limiter {
    force: f64,
    torque: f64,
    force_rate: f64,
    torque_rate: f64,
    period: f64,
    output_dof: u8,
    last: Wrench,
}

/// What the limiter had to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LimitedWrench {
    /// The wrench was not finite.
    pub not_finite: bool,
    /// A magnitude was cut.
    pub clamped: bool,
    /// A rate of change was cut.
    pub slewed: bool,
}

impl Limiter {
    /// The tighter of the device's and the configured limits.
    pub fn new(spec: &DeviceSpec, config: &HapticConfig) -> Self {
        Self {
            force: config.limits.force.min(spec.max_force),
            torque: config.limits.torque.min(spec.max_torque),
            force_rate: config.limits.force_rate,
            torque_rate: config.limits.torque_rate,
            period: config.period(),
            output_dof: spec.output_dof,
            last: Wrench::ZERO,
        }
    }

    /// Greatest force that can leave, N.
    pub fn max_force(&self) -> f64 {
        self.force
    }

    /// Greatest torque that can leave, N·m.
    pub fn max_torque(&self) -> f64 {
        self.torque
    }

    /// The wrench that may leave in place of `wanted`, shown with strength `gain` (0 ..= 1), `dt`
    /// seconds after the last one.
    ///
    /// The magnitudes are cut before the strength counts: while a force is let go it is never more
    /// than the strength's share of its limit, unless the slew limit is slower.
    ///
    /// Force and torque stay within their magnitudes always: the slewed wrench lies on the segment
    /// between two wrenches inside a ball. After a gap the slew limit still counts two periods at
    /// most, so a late tick does not jump.
    pub fn limit(&mut self, wanted: &Wrench, gain: f64, dt: f64) -> (Wrench, LimitedWrench) {
        let mut done = LimitedWrench {
            not_finite: !wanted.is_finite(),
            ..LimitedWrench::default()
        };
        let wanted = if done.not_finite {
            Wrench::ZERO
        } else {
            self.mask(wanted)
        };
        let clamped = Wrench {
            torque: clamp(wanted.torque, self.torque),
            force: clamp(wanted.force, self.force),
        };
        done.clamped = clamped != wanted;
        let shown = clamped * gain;
        let dt = dt.clamp(0.0, 2.0 * self.period);
        let slewed = Wrench {
            torque: approach(self.last.torque, shown.torque, self.torque_rate * dt),
            force: approach(self.last.force, shown.force, self.force_rate * dt),
        };
        done.slewed = slewed != shown;
        // A second clamp removes the last rounding error of the segment.
        self.last = Wrench {
            torque: clamp(slewed.torque, self.torque),
            force: clamp(slewed.force, self.force),
        };
        (self.last, done)
    }

    /// Starts again from no force.
    pub fn reset(&mut self) {
        self.last = Wrench::ZERO;
    }

    fn mask(&self, wrench: &Wrench) -> Wrench {
        Wrench {
            torque: if self.output_dof >= 6 {
                wrench.torque
            } else {
                DVec3::ZERO
            },
            force: match self.output_dof {
                0 => DVec3::ZERO,
                1 | 2 => wrench.force.with_z(0.0),
                _ => wrench.force,
            },
        }
    }
}

fn clamp(v: DVec3, limit: f64) -> DVec3 {
    // Scaling first by the largest component keeps the length from overflowing.
    let largest = v.abs().max_element();
    if largest == 0.0 {
        return v;
    }
    let length = largest * (v / largest).length();
    if length <= limit {
        return v;
    }
    // One part in 1e12 inside, so that rounding cannot put it outside.
    let unit = (v / largest).normalize();
    unit * (limit * (1.0 - 1e-12))
}

fn approach(from: DVec3, to: DVec3, step: f64) -> DVec3 {
    let change = to - from;
    let length = change.length();
    if length <= step {
        to
    } else {
        from + change * (step / length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limiter() -> Limiter {
        let spec = crate::device::simulated::OperatorConfig::default().spec();
        Limiter::new(&spec, &HapticConfig::default())
    }

    fn force(x: f64) -> Wrench {
        Wrench {
            force: DVec3::new(x, 0.0, 0.0),
            ..Wrench::ZERO
        }
    }

    #[test]
    fn what_is_not_finite_becomes_nothing() {
        let mut limiter = limiter();
        let (out, done) = limiter.limit(&force(f64::NAN), 1.0, 0.001);
        assert_eq!(out, Wrench::ZERO);
        assert!(done.not_finite);
        let (out, done) = limiter.limit(&force(f64::MAX), 1.0, 0.001);
        assert!(out.is_finite() && done.clamped);
    }

    #[test]
    fn slew_is_per_second_and_a_gap_does_not_jump() {
        let mut limiter = limiter();
        let (out, done) = limiter.limit(&force(5.0), 1.0, 0.001);
        assert!((out.force.x - 2.0).abs() < 1e-12 && done.slewed);
        let (out, _) = limiter.limit(&force(-5.0), 1.0, 10.0);
        assert!((out.force.x - -2.0).abs() < 1e-12, "two periods at most");
    }

    #[test]
    fn a_force_beyond_the_limit_is_let_go_from_the_limit() {
        let mut limiter = limiter();
        let (out, done) = limiter.limit(&force(500.0), 0.1, 0.001);
        assert!((out.force.x - 0.5).abs() < 1e-9 && done.clamped);
    }

    #[test]
    fn a_force_only_device_gets_no_torque() {
        let mut spec = crate::device::simulated::OperatorConfig::default().spec();
        spec.output_dof = 2;
        let mut limiter = Limiter::new(&spec, &HapticConfig::default());
        let wanted = Wrench {
            torque: DVec3::ONE,
            force: DVec3::ONE * 0.1,
        };
        let (out, _) = limiter.limit(&wanted, 1.0, 1.0);
        assert_eq!(out.torque, DVec3::ZERO);
        assert_eq!(out.force, DVec3::new(0.1, 0.1, 0.0));
    }

    proptest! {
        #[test]
        fn never_beyond_the_limits(values in prop::collection::vec(any::<[f64; 6]>(), 1..50)) {
            let mut limiter = limiter();
            for v in values {
                let wanted = Wrench {
                    torque: DVec3::new(v[0], v[1], v[2]),
                    force: DVec3::new(v[3], v[4], v[5]),
                };
                let before = limiter.last;
                let (out, _) = limiter.limit(&wanted, 1.0, 0.001);
                prop_assert!(out.force.length() <= limiter.force);
                prop_assert!(out.torque.length() <= limiter.torque);
                prop_assert!((out - before).force.length() <= 2.0 * (1.0 + 1e-9));
            }
        }
    }
}
