//! A cutting-plane model of the energy around the device, and its proximal point.
//!
//! The virtual object rests where the energy and the coupling spring together are least:
//! `x = argmin E(x) + |x - d|²/2`, with `d` the device and lengths and angles scaled by the square
//! roots of the coupling's stiffnesses. At zero clearance `E` has kinks with slopes of opposite
//! sign on their two sides; a step along the gradient jumps to and fro over them. The model
//! `m(x) = max_i e_i + g_i·(x - x_i)` of the last evaluations keeps both sides, so its minimum
//! lies in the kink, and the spring force there is a convex combination of forces the field really
//! has. (Kiwiel, Methods of Descent for Nondifferentiable Optimization, 1985.)

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;

/// Cuts kept. Six dimensions need seven for one vertex; the rest is memory along edges.
const CAPACITY: usize = 16;

/// Pair steps of the dual solver per solve; it stops earlier nearly always.
const MAX_STEPS: usize = 200;

/// Duality gap, joules, at which a solve is done: 0.1 µm, 0.1 mN at 1 kN/m.
const GAP: f64 = 5e-12;

/// Scaled coordinates: angular part first.
pub(crate) type Six = [f64; 6];

pub(crate) fn dot(a: &Six, b: &Six) -> f64 {
    (0..6).map(|i| a[i] * b[i]).sum()
}

fn add_scaled(a: &Six, b: &Six, factor: f64) -> Six {
    std::array::from_fn(|i| a[i] + factor * b[i])
}

/// The stiffnesses that scale angles and lengths to square roots of joules.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Metric {
    /// √(N·m/rad).
    pub(crate) angular: f64,
    /// √(N/m).
    pub(crate) linear: f64,
    /// Leave rotations out.
    pub(crate) lock_rotation: bool,
}

impl Metric {
    pub(crate) fn new(rotational_stiffness: f64, stiffness: f64, lock_rotation: bool) -> Self {
        Self {
            angular: rotational_stiffness.sqrt(),
            linear: stiffness.sqrt(),
            lock_rotation,
        }
    }

    pub(crate) fn scaled(&self, twist: &Twist) -> Six {
        let a = if self.lock_rotation {
            DVec3::ZERO
        } else {
            twist.angular * self.angular
        };
        let l = twist.linear * self.linear;
        [a.x, a.y, a.z, l.x, l.y, l.z]
    }

    pub(crate) fn twist(&self, y: &Six) -> Twist {
        Twist {
            angular: DVec3::new(y[0], y[1], y[2]) / self.angular,
            linear: DVec3::new(y[3], y[4], y[5]) / self.linear,
        }
    }

    fn gradient(&self, wrench: &Wrench) -> Six {
        let a = if self.lock_rotation {
            DVec3::ZERO
        } else {
            -wrench.torque / self.angular
        };
        let l = -wrench.force / self.linear;
        [a.x, a.y, a.z, l.x, l.y, l.z]
    }
}

#[derive(Debug, Clone, Copy)]
struct Cut {
    at: Pose,
    value: f64,
    gradient: Six,
    weight: f64,
    /// Of `at`, relative to the device.
    offset: Six,
    /// Value of the cut at the device.
    intercept: f64,
}

/// The model: at most [`CAPACITY`] cuts, in place.
#[derive(Debug, Clone)]
pub(crate) struct Bundle {
    metric: Metric,
    cuts: Vec<Cut>,
}

impl Bundle {
    pub(crate) fn new(metric: Metric) -> Self {
        Self {
            metric,
            cuts: Vec::with_capacity(CAPACITY),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.cuts.clear();
    }

    /// Expresses every cut about a new device pose.
    pub(crate) fn rebase(&mut self, device: &Pose) {
        for cut in &mut self.cuts {
            cut.offset = self.metric.scaled(&device.twist_to(&cut.at));
            cut.intercept = cut.value - dot(&cut.gradient, &cut.offset);
        }
    }

    /// Value of the model at `y`; minus infinity while it is empty.
    pub(crate) fn value(&self, y: &Six) -> f64 {
        self.cuts
            .iter()
            .map(|c| c.intercept + dot(&c.gradient, y))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Adds what was found at `at`, `y` from the device: `energy` and `wrench`.
    ///
    /// Cuts that would lie above `energy - |y - y_i|²` there are lowered: the field is not convex,
    /// and what was seen far away must not hold the object back here. The margin is twice the
    /// spring's own energy, so where the field bends down by less than the spring bends up, the
    /// newest cut alone decides.
    pub(crate) fn add(&mut self, at: Pose, y: Six, energy: f64, wrench: &Wrench) {
        for cut in &mut self.cuts {
            let apart = add_scaled(&y, &cut.offset, -1.0);
            let excess = cut.intercept + dot(&cut.gradient, &y) - (energy - dot(&apart, &apart));
            if excess > 0.0 {
                cut.value -= excess;
                cut.intercept -= excess;
            }
        }
        let gradient = self.metric.gradient(wrench);
        let weight = self.make_room(&y);
        self.cuts.push(Cut {
            at,
            value: energy,
            gradient,
            weight,
            offset: y,
            intercept: energy - dot(&gradient, &y),
        });
    }

    /// Drops the unused cut that lies lowest at `y` (or the least used one) and gives its weight
    /// away.
    fn make_room(&mut self, y: &Six) -> f64 {
        if self.cuts.is_empty() {
            return 1.0;
        }
        if self.cuts.len() < CAPACITY {
            return 0.0;
        }
        let key = |c: &Cut| (c.weight, c.intercept + dot(&c.gradient, y));
        let worst = (0..self.cuts.len())
            .min_by(|&i, &j| {
                let (a, b) = (key(&self.cuts[i]), key(&self.cuts[j]));
                a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
            })
            .unwrap_or(0);
        self.cuts.swap_remove(worst).weight
    }

    /// The minimum of `model(y) + |y|²/2`: the origin while the model is empty.
    ///
    /// The dual, over weights on the simplex, is climbed pair by pair (Mitchell, Demyanov,
    /// Malozemov 1974) from the last solve's weights.
    pub(crate) fn proximal_point(&mut self) -> Six {
        let mut sum = [0.0; 6];
        for cut in &self.cuts {
            sum = add_scaled(&sum, &cut.gradient, cut.weight);
        }
        for _ in 0..MAX_STEPS {
            let Some((up, down, gap)) = self.steepest_pair(&sum) else {
                break;
            };
            if gap.is_nan() || gap <= GAP {
                break;
            }
            let (rise, fall) = (self.cuts[up], self.cuts[down]);
            let change = add_scaled(&rise.gradient, &fall.gradient, -1.0);
            let climb = (rise.intercept - dot(&rise.gradient, &sum))
                - (fall.intercept - dot(&fall.gradient, &sum));
            let curvature = dot(&change, &change);
            let step = if curvature * fall.weight > climb {
                climb / curvature
            } else {
                fall.weight
            };
            self.cuts[up].weight += step;
            self.cuts[down].weight = (fall.weight - step).max(0.0);
            sum = add_scaled(&sum, &change, step);
        }
        sum.map(|s| -s)
    }

    /// The cut whose weight should grow, the used one whose weight should shrink, and the duality
    /// gap.
    fn steepest_pair(&self, sum: &Six) -> Option<(usize, usize, f64)> {
        let (mut up, mut down) = (None, None);
        let (mut most, mut least, mut mean) = (f64::NEG_INFINITY, f64::INFINITY, 0.0);
        for (i, cut) in self.cuts.iter().enumerate() {
            let slope = cut.intercept - dot(&cut.gradient, sum);
            mean += cut.weight * slope;
            if slope > most {
                (most, up) = (slope, Some(i));
            }
            if cut.weight > 0.0 && slope < least {
                (least, down) = (slope, Some(i));
            }
        }
        Some((up?, down?, most - mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle(stiffness: f64) -> Bundle {
        Bundle::new(Metric::new(1.0, stiffness, false))
    }

    fn rest(bundle: &mut Bundle) -> Twist {
        let y = bundle.proximal_point();
        bundle.metric.twist(&y)
    }

    /// Evaluates `energy(x) , force(x)` along x at offsets from the device.
    fn fill(bundle: &mut Bundle, at: &[f64], energy: impl Fn(f64) -> (f64, f64)) {
        for &x in at {
            let pose = Pose::from_translation(DVec3::new(x, 0.0, 0.0));
            let y = bundle.metric.scaled(&Pose::IDENTITY.twist_to(&pose));
            let (e, f) = energy(x);
            let wrench = Wrench {
                force: DVec3::new(f, 0.0, 0.0),
                ..Wrench::ZERO
            };
            bundle.add(pose, y, e, &wrench);
        }
    }

    #[test]
    fn one_slope_is_balanced_by_the_spring() {
        // E = 3 x: the spring of 1000 N/m gives way by 3 mm against it.
        let mut bundle = bundle(1000.0);
        fill(&mut bundle, &[0.0], |x| (3.0 * x, -3.0));
        let twist = rest(&mut bundle);
        assert!((twist.linear.x - -0.003).abs() < 1e-12);
    }

    #[test]
    fn a_kink_is_found_from_one_cut_on_each_side() {
        // E = 5 |x - 1 mm|; the device is 1 mm off, which the spring cannot tear out.
        let kink = |x: f64| (5.0 * (x - 0.001).abs(), -5.0 * (x - 0.001).signum());
        let mut bundle = bundle(1000.0);
        fill(&mut bundle, &[0.0, 0.0025], kink);
        let twist = rest(&mut bundle);
        // GAP allows 0.1 µm.
        assert!((twist.linear.x - 0.001).abs() < 1e-7, "{}", twist.linear.x);
    }

    #[test]
    fn an_old_cut_does_not_hold_back_where_the_field_bends_down() {
        // E = -100 x² with a 1000 N/m spring: every new cut must decide alone.
        let dome = |x: f64| (-100.0 * x * x, 200.0 * x);
        let mut bundle = bundle(1000.0);
        fill(&mut bundle, &[0.001, 0.002, 0.003], dome);
        let twist = rest(&mut bundle);
        let newest = 200.0 * 0.003 / 1000.0;
        assert!((twist.linear.x - newest).abs() < 1e-6, "{}", twist.linear.x);
    }

    #[test]
    fn weights_stay_a_partition_when_cuts_are_dropped() {
        let bowl = |x: f64| (2000.0 * x * x, -4000.0 * x);
        let mut bundle = bundle(1000.0);
        for k in 0..60 {
            fill(&mut bundle, &[0.004 * (k as f64 * 2.4).sin()], bowl);
            bundle.proximal_point();
            let total: f64 = bundle.cuts.iter().map(|c| c.weight).sum();
            assert!((total - 1.0).abs() < 1e-12);
            assert!(bundle.cuts.len() <= CAPACITY);
        }
    }
}
