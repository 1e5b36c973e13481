//! A cutting-plane model of the energy around the device, and its proximal point.
//!
//! The virtual object rests where the energy and the coupling spring together are least:
//! `x = argmin E(x) + |x - d|²/2`, with `d` the device and lengths and angles scaled by the square
//! roots of the coupling's stiffnesses. At zero clearance `E` has kinks with slopes of opposite
//! sign on their two sides; a step along the gradient jumps to and fro over them. The model
//! `m(x) = max_i e_i + g_i·(x - x_i)` of the last evaluations keeps both sides, so its minimum
//! lies in the kink, and the spring force there is a convex combination of forces the field really
//! has. (Kiwiel, Methods of Descent for Nondifferentiable Optimization, 1985.)

use fft_correlate::{Pose, Wrench};

use crate::path::metric::{Metric, Six, dot};

/// Cuts kept. Six dimensions need seven for one vertex; the rest is memory along edges.
const CAPACITY: usize = 16;

/// Cuts taken into use per solve; one to three nearly always.
const MAX_STEPS: usize = 50;

/// Duality gap, joules, at which a solve is done: 0.3 µm or 0.3 mN at 1 kN/m.
const GAP: f64 = 5e-11;

fn add_scaled(a: &Six, b: &Six, factor: f64) -> Six {
    std::array::from_fn(|i| a[i] + factor * b[i])
}

#[derive(Debug, Clone, Copy)]
struct Cut {
    at: Pose,
    value: f64,
    wrench: Wrench,
    gradient: Six,
    weight: f64,
    /// Of `at`, relative to the device.
    offset: Six,
    /// Value of the cut at the device.
    intercept: f64,
}

impl Cut {
    /// Of the dual along this cut's weight, where the weighted gradients add up to `sum`.
    fn slope(&self, sum: &Six) -> f64 {
        self.intercept - dot(&self.gradient, sum)
    }
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

    pub(crate) fn is_empty(&self) -> bool {
        self.cuts.is_empty()
    }

    /// Measures lengths and angles anew; [`Bundle::rebase`] must follow.
    pub(crate) fn measure_by(&mut self, metric: Metric) {
        self.metric = metric;
        for cut in &mut self.cuts {
            cut.gradient = metric.gradient(&cut.wrench);
        }
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
            wrench: *wrench,
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
    /// The dual, over weights on the simplex, is climbed from the last solve's weights by an active
    /// set (Wolfe 1976): add the steepest cut, go to the best weights of the cuts in use, drop
    /// those that would turn negative.
    pub(crate) fn proximal_point(&mut self) -> Six {
        for _ in 0..MAX_STEPS {
            let sum = self.sum();
            let Some((steepest, gap)) = self.steepest(&sum) else {
                break;
            };
            if gap.is_nan() || gap <= GAP {
                break;
            }
            let mut used = [false; CAPACITY];
            for (flag, cut) in used.iter_mut().zip(&self.cuts) {
                *flag = cut.weight > 0.0;
            }
            used[steepest] = true;
            self.settle(&mut used);
            if self.cuts[steepest].weight <= 0.0 {
                // Rounding: nothing more to gain.
                break;
            }
        }
        self.sum().map(|s| -s)
    }

    fn sum(&self) -> Six {
        let cuts = self.cuts.iter();
        cuts.fold([0.0; 6], |sum, c| add_scaled(&sum, &c.gradient, c.weight))
    }

    /// The cut whose weight should grow most, and the duality gap.
    fn steepest(&self, sum: &Six) -> Option<(usize, f64)> {
        let (mut up, mut most, mut mean) = (None, f64::NEG_INFINITY, 0.0);
        for (i, cut) in self.cuts.iter().enumerate() {
            let slope = cut.slope(sum);
            mean += cut.weight * slope;
            if slope > most {
                (most, up) = (slope, Some(i));
            }
        }
        Some((up?, most - mean))
    }

    /// Moves to the best weights of the cuts in use, one of them at a time leaving as its weight
    /// runs out on the way.
    fn settle(&mut self, used: &mut [bool; CAPACITY]) {
        for _ in 0..CAPACITY {
            let target = self.best_weights(used);
            let mut share = 1.0;
            let mut leaves = None;
            for (i, cut) in self.cuts.iter().enumerate() {
                if used[i] && target[i] < 0.0 {
                    let until = cut.weight / (cut.weight - target[i]);
                    if until < share {
                        (share, leaves) = (until, Some(i));
                    }
                }
            }
            for (cut, goal) in self.cuts.iter_mut().zip(&target) {
                cut.weight = (cut.weight + share * (goal - cut.weight)).max(0.0);
            }
            let Some(i) = leaves else {
                return;
            };
            self.cuts[i].weight = 0.0;
            used[i] = false;
        }
    }

    /// Weights, of either sign, adding up to one, at which the dual of the used cuts is greatest.
    fn best_weights(&self, used: &[bool; CAPACITY]) -> [f64; CAPACITY] {
        let mut target = [0.0; CAPACITY];
        let mut members = [0; CAPACITY];
        let mut count = 0;
        for i in (0..self.cuts.len()).filter(|i| used[*i]) {
            members[count] = i;
            count += 1;
        }
        // Relative to the first: |g0 + D m|²/2 - c·m is least where DᵀD m = c - Dᵀ g0.
        let first = &self.cuts[members[0]];
        let mut change = [[0.0; 6]; CAPACITY];
        let mut right = [0.0; CAPACITY];
        for k in 1..count {
            let cut = &self.cuts[members[k]];
            change[k] = add_scaled(&cut.gradient, &first.gradient, -1.0);
            right[k] = cut.intercept - first.intercept - dot(&change[k], &first.gradient);
        }
        solve_gram(&change[1..count], &mut right[1..count]);
        target[members[0]] = 1.0 - right[1..count].iter().sum::<f64>();
        for k in 1..count {
            target[members[k]] = right[k];
        }
        target
    }
}

/// Solves `D Dᵀ m = right` in place by Cholesky, `D` the rows. More rows than dimensions leave the
/// matrix singular; one part in 1e12 of its greatest entry on the diagonal makes the solution
/// unique and the dual lower by as little.
fn solve_gram(rows: &[Six], right: &mut [f64]) {
    let n = rows.len();
    let mut l = [[0.0; CAPACITY]; CAPACITY];
    let largest = rows.iter().map(|r| dot(r, r)).fold(0.0, f64::max);
    let shift = 1e-12 * largest + f64::MIN_POSITIVE;
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let entry = dot(&rows[i], &rows[j]) - known;
            l[i][j] = if i == j {
                (entry + shift).max(shift).sqrt()
            } else {
                entry / l[j][j]
            };
        }
    }
    for i in 0..n {
        let known: f64 = (0..i).map(|k| l[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / l[i][i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| l[k][i] * right[k]).sum();
        right[i] = (right[i] - known) / l[i][i];
    }
}

#[cfg(test)]
#[path = "bundle_tests.rs"]
mod tests;
