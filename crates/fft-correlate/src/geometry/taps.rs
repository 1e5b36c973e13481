//! Cubic B-splines along one axis of nodes: which coefficients, with which weights and slopes.
//!
//! Value, slope and curvature are continuous. The coefficients are those of
//! [`Prefilter`] along translations, of [`crate::rotations::chart`] along rotations.
//!
//! The coefficients of the spline through values `f` fulfil `c[i-1] + 4 c[i] + c[i+1] = 6 f[i]` along
//! each axis, with the coefficients beyond the ends extrapolated as [`Taps::open`] does: there the
//! first two equations make `c[0] - c[1] = f[0] - f[1]`, and alike at the other end.

/// Four neighbouring nodes of one axis, the weights of their coefficients, and the weights'
/// derivatives by the coordinate (in units of the spacing). Absent nodes repeat the last one with weight 0.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taps {
    pub(crate) nodes: [usize; 4],
    pub(crate) weights: [f64; 4],
    pub(crate) slopes: [f64; 4],
}

impl Taps {
    /// The only node of an axis along which nothing changes.
    const SINGLE: Self = Self {
        nodes: [0; 4],
        weights: [1.0, 0.0, 0.0, 0.0],
        slopes: [0.0; 4],
    };

    /// Taps at coordinate `x` (finite; node `i` lies at `x = i`) of an axis of `n` nodes.
    ///
    /// Beyond the first and last node the polynomial of the last cell continues. The coefficients
    /// beyond them are quadratic extrapolations, so quadratics are exact up to the ends.
    pub(crate) fn open(x: f64, n: usize) -> Self {
        if n == 1 {
            return Self::SINGLE;
        }
        let cell = x.floor().clamp(0.0, (n - 2) as f64);
        let cell_index = cell as usize;
        let mut taps = basis(x - cell);
        // Slot s stands for node cell_index - 1 + s; fold the slots outside 0..n into the others.
        if cell_index == 0 {
            taps.fold_ghost([0, 1, 2, 3], n);
        }
        if cell_index + 2 == n {
            taps.fold_ghost([3, 2, 1, 0], n);
        }
        // Rows of at least four nodes are read as four neighbours: slide the slots inside.
        if cell_index == 0 {
            taps.slide_left();
        } else if cell_index + 2 == n && n >= 4 {
            taps.slide_right();
        }
        let first = if cell_index == 0 {
            0
        } else if n >= 4 {
            (cell_index - 1).min(n - 4)
        } else {
            cell_index - 1
        };
        taps.nodes = std::array::from_fn(|s| (first + s).min(n - 1));
        taps
    }

    /// Taps of an axis of `n >= 2` nodes that closes on itself after `n` cells.
    pub(crate) fn periodic(x: f64, n: usize) -> Self {
        let cell = x.floor();
        let mut taps = basis(x - cell);
        let first = (cell - 1.0).rem_euclid(n as f64) as usize;
        taps.nodes = std::array::from_fn(|s| (first + s) % n);
        taps
    }

    /// Replaces the value of slot `order[0]`, a ghost, by its extrapolation from the next slots.
    fn fold_ghost(&mut self, order: [usize; 4], n: usize) {
        let coefficients: &[f64] = if n == 2 {
            &[2.0, -1.0]
        } else {
            &[3.0, -3.0, 1.0]
        };
        for table in [&mut self.weights, &mut self.slopes] {
            let ghost = std::mem::take(&mut table[order[0]]);
            for (slot, c) in order[1..].iter().zip(coefficients) {
                table[*slot] += c * ghost;
            }
        }
    }

    fn slide_left(&mut self) {
        for table in [&mut self.weights, &mut self.slopes] {
            table.rotate_left(1);
        }
    }

    fn slide_right(&mut self) {
        for table in [&mut self.weights, &mut self.slopes] {
            table.rotate_right(1);
        }
    }
}

/// Weights of the coefficients at -1, 0, 1, 2 for a value at `f`.
fn basis(f: f64) -> Taps {
    let g = 1.0 - f;
    let near = |f: f64| 2.0 / 3.0 + f * f * (0.5 * f - 1.0);
    let near_slope = |f: f64| f * (1.5 * f - 2.0);
    Taps {
        nodes: [0; 4],
        weights: [g * g * g / 6.0, near(f), near(g), f * f * f / 6.0],
        slopes: [-0.5 * g * g, near_slope(f), -near_slope(g), 0.5 * f * f],
    }
}

/// 1 at `t <= 0`, 0 at `t >= 1`, with its derivative; once continuously differentiable.
pub(crate) fn fade(t: f64) -> (f64, f64) {
    let t = t.clamp(0.0, 1.0);
    (1.0 - t * t * (3.0 - 2.0 * t), -6.0 * t * (1.0 - t))
}

/// How far outside its nodes an axis still answers, in spacings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    /// Over this the slope comes to rest and the axis is covered less and less.
    pub(crate) margin: f64,
    /// Over this, beyond the first and the last node, what is read fades; at least the margin.
    pub(crate) fade: [f64; 2],
}

/// Where an axis is read for a coordinate that may lie beyond its ends, and what that counts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reach {
    /// Coordinate to read at; beyond an end it comes to rest a quarter margin further out.
    pub(crate) at: f64,
    /// Derivative of `at` by the coordinate: 1 inside, falling to 0 over the margin.
    pub(crate) slope: f64,
    /// 1 inside, falling to 0 over the margin.
    pub(crate) coverage: f64,
    /// What is read counts by this: 1 inside, falling to 0 over the fade.
    pub(crate) weight: f64,
    /// Derivative of `weight` by the coordinate.
    pub(crate) weight_slope: f64,
}

impl Reach {
    /// For an axis of `n` nodes; `None` where nothing counts (and for NaN).
    pub(crate) fn new(x: f64, n: usize, edge: &Edge) -> Option<Self> {
        let last = (n - 1) as f64;
        let (end, outwards, beyond, length) = if x < 0.0 {
            (0.0, -1.0, -x, edge.fade[0])
        } else {
            (last, 1.0, x - last, edge.fade[1])
        };
        if beyond <= 0.0 {
            return Some(Self {
                at: x,
                slope: 1.0,
                coverage: 1.0,
                weight: 1.0,
                weight_slope: 0.0,
            });
        }
        let faded = beyond / length;
        if faded >= 1.0 || faded.is_nan() {
            return None;
        }
        let rest = (1.0 - beyond / edge.margin).max(0.0);
        let (weight, slope) = fade(faded);
        Some(Self {
            at: end + outwards * 0.25 * edge.margin * (1.0 - rest.powi(4)),
            slope: rest.powi(3),
            coverage: fade(beyond / edge.margin).0,
            weight,
            weight_slope: outwards * slope / length,
        })
    }

    /// Whether the coordinate lies between the first and the last node.
    pub(crate) fn is_inside(&self) -> bool {
        self.weight >= 1.0
    }
}

/// Solves for the coefficients; keeps its factors from one call to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prefilter {
    /// Of the elimination along one axis.
    factors: Vec<f32>,
}

impl Prefilter {
    /// Replaces values in C order by the coefficients of the spline through them. Axes of one or
    /// two nodes hold lines, whose coefficients are their values.
    pub(crate) fn apply(&mut self, shape: [usize; 3], values: &mut [f32]) {
        let [nx, ny, nz] = shape;
        self.along(nx, ny * nz, values);
        for plane in values.chunks_exact_mut((ny * nz).max(1)) {
            self.along(ny, nz, plane);
            for line in plane.chunks_exact_mut(nz.max(1)) {
                self.along(nz, 1, line);
            }
        }
    }

    /// Along the first axis of `n` rows of `width` values.
    fn along(&mut self, n: usize, width: usize, values: &mut [f32]) {
        if n < 3 {
            return;
        }
        self.factor(n);
        let last = n - 1;
        subtract(values, width, 0, 1);
        subtract(values, width, last, last - 1);
        for i in 1..last {
            let (before, row) = pair(values, width, i - 1, i);
            let factor = self.factors[i];
            for (v, b) in row.iter_mut().zip(before) {
                *v = (6.0 * *v - *b) * factor;
            }
        }
        let (before, row) = pair(values, width, last - 1, last);
        let factor = 1.0 / (1.0 + self.factors[last - 1]);
        for (v, b) in row.iter_mut().zip(before) {
            *v = (*v + *b) * factor;
        }
        for i in (0..last).rev() {
            let (row, after) = pair(values, width, i, i + 1);
            let factor = self.factors[i];
            for (v, a) in row.iter_mut().zip(after) {
                *v -= factor * *a;
            }
        }
    }

    /// What each row, but the last, has of the next once those before it are eliminated.
    fn factor(&mut self, n: usize) {
        self.factors.clear();
        let mut factor = -1.0f64;
        for _ in 1..n {
            self.factors.push(factor as f32);
            factor = 1.0 / (4.0 - factor);
        }
    }
}

/// Row `of` becomes itself less row `less`.
fn subtract(values: &mut [f32], width: usize, of: usize, less: usize) {
    let (first, second) = pair(values, width, of.min(less), of.max(less));
    let (to, from) = match of < less {
        true => (first, second),
        false => (second, first),
    };
    to.iter_mut().zip(from).for_each(|(v, f)| *v -= *f);
}

/// Rows `first < second`.
fn pair(values: &mut [f32], width: usize, first: usize, second: usize) -> (&mut [f32], &mut [f32]) {
    let (head, tail) = values.split_at_mut(second * width);
    (&mut head[first * width..][..width], &mut tail[..width])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::taps::Prefilter;
    use crate::geometry::taps::Taps;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    fn value(taps: &Taps, coefficients: &[f32]) -> (f64, f64) {
        let of = |s: usize| f64::from(coefficients[taps.nodes[s]]);
        let sum = |w: &[f64; 4]| (0..4).map(|s| w[s] * of(s)).sum();
        (sum(&taps.weights), sum(&taps.slopes))
    }

    /// Splines with extrapolated coefficients reproduce every quadratic on any axis long enough to
    /// define it, inside and a little beyond; single precision errs by 6e-8 of values up to 20.
    #[test]
    fn splines_reproduce_the_polynomials_an_axis_can_hold() {
        let f = |degree: usize, x: f64| [1.7, 1.7 - 0.3 * x, 1.7 - 0.3 * x + 0.21 * x * x][degree];
        let df = |degree: usize, x: f64| [0.0, -0.3, -0.3 + 0.42 * x][degree];
        for n in 1..9 {
            let degree = (n - 1).min(2);
            let mut coefficients: Vec<f32> = (0..n).map(|i| f(degree, i as f64) as f32).collect();
            Prefilter::default().apply([1, 1, n], &mut coefficients);
            for k in 0..200 {
                let x = -0.5 + (n as f64) * k as f64 / 199.0;
                let taps = Taps::open(x, n);
                let (v, d) = value(&taps, &coefficients);
                assert!((v - f(degree, x)).abs() < 1e-5, "n {n} x {x}: {v}");
                assert!((d - df(degree, x)).abs() < 2e-5, "n {n} x {x}: {d}");
                if n >= 4 {
                    assert!((1..4).all(|s| taps.nodes[s] == taps.nodes[0] + s));
                }
            }
        }
    }

    /// Weights are the derivatives' integrals, sum to one, and join with two derivatives.
    #[test]
    fn weights_are_those_of_a_cubic_spline() {
        let step = 1e-4;
        for k in 0..50 {
            let x = 3.0 + 0.013 * f64::from(k);
            let [a, m, b] = [x - step, x, x + step].map(|x| Taps::open(x, 9));
            assert!((m.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            if a.nodes == b.nodes {
                for s in 0..4 {
                    let slope = (b.weights[s] - a.weights[s]) / (2.0 * step);
                    assert!((slope - m.slopes[s]).abs() < 1e-7);
                }
            }
        }
        let (before, at) = (Taps::open(4.0 - 1e-12, 9), Taps::open(4.0, 9));
        for s in 1..4 {
            assert!((before.weights[s] - at.weights[s - 1]).abs() < 1e-11);
            assert!((before.slopes[s] - at.slopes[s - 1]).abs() < 1e-11);
        }
    }

    /// With the exact coefficients of a wave of 12 nodes: fourth order, `(tau/12)^4/384` = 2e-4 and a
    /// little.
    #[test]
    fn periodic_axis_closes() {
        let (n, wave) = (12, std::f64::consts::TAU / 12.0);
        let gain = 3.0 / (2.0 + wave.cos());
        let coefficients: Vec<f32> = (0..n)
            .map(|i| (gain * (wave * i as f64).sin()) as f32)
            .collect();
        for k in 0..300 {
            let x = -20.0 + k as f64 * 0.17;
            let (a, da) = value(&Taps::periodic(x, n), &coefficients);
            let (b, db) = value(&Taps::periodic(x + 36.0, n), &coefficients);
            assert!((a - b).abs() < 1e-12 && (da - db).abs() < 1e-12);
            assert!((a - (wave * x).sin()).abs() < 2.5e-4);
        }
    }

    #[test]
    fn reach_and_its_slopes_are_continuous_and_consistent() {
        let (n, step) = (7, 1e-5);
        let edge = Edge {
            margin: 2.0,
            fade: [3.0, 11.0],
        };
        for k in 0..4000 {
            let x = -3.5 + k as f64 * 0.0055 + 1e-7;
            let at = |x: f64| Reach::new(x, n, &edge);
            let (Some(a), Some(m), Some(b)) = (at(x - step), at(x), at(x + step)) else {
                assert!(!(-2.9999..=16.9999).contains(&x));
                continue;
            };
            assert!(((b.at - a.at) / (2.0 * step) - m.slope).abs() < 1e-4);
            assert!(((b.weight - a.weight) / (2.0 * step) - m.weight_slope).abs() < 1e-4);
            assert_eq!(m.coverage > 0.0, (-2.0..8.0).contains(&x));
            assert_eq!(m.is_inside(), (0.0..=6.0).contains(&x));
        }
        assert!(Reach::new(f64::NAN, n, &edge).is_none());
    }

    /// The spline read at its nodes is what it was made of; single precision errs by some 1e-7 of
    /// numbers up to 27 times the values.
    #[test]
    fn splines_pass_through_their_values() {
        let mut rng = SmallRng::seed_from_u64(3);
        for shape in [[1, 1, 1], [2, 3, 4], [5, 1, 7], [3, 9, 2], [12, 6, 25]] {
            let length = shape.iter().product();
            let values: Vec<f32> = (0..length).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut coefficients = values.clone();
            Prefilter::default().apply(shape, &mut coefficients);
            let [_, ny, nz] = shape;
            for (flat, value) in values.iter().enumerate() {
                let node = [flat / (ny * nz), flat / nz % ny, flat % nz];
                let taps = [0, 1, 2].map(|k| Taps::open(node[k] as f64, shape[k]));
                let mut sum = 0.0;
                for slots in 0..64usize {
                    let s = [slots / 16, slots / 4 % 4, slots % 4];
                    let weight: f64 = (0..3).map(|k| taps[k].weights[s[k]]).product();
                    let [x, y, z] = [0, 1, 2].map(|k| taps[k].nodes[s[k]]);
                    sum += weight * f64::from(coefficients[(x * ny + y) * nz + z]);
                }
                assert!((sum - f64::from(*value)).abs() < 1e-5, "{shape:?} {node:?}");
            }
        }
    }
}
