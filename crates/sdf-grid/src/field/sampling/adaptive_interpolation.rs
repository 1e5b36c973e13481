//! Adaptive interpolation: where values interpolated between some nodes of a block agree with
//! others that were computed, the rest are interpolated too.
//!
//! Away from the skeleton and from the reach of edges the density varies over lengths of the order
//! of the distance from the boundary, many nodes on a fine lattice.

use num_complex::Complex32;

use super::blocks::along_curve;
use crate::field::packet::points::LANES;

/// Nodes along each edge of a block.
const EDGE: usize = 8;

/// Nodes per axis between which a block is interpolated: as few as do, from the first on. All
/// belong to the last.
const KNOTS: [&[usize]; 3] = [&[0, 3, 7], &[0, 2, 5, 7], &[0, 2, 3, 5, 7]];

/// Nodes to check at: off the knots on every axis, where interpolation is worst, and next to the
/// block's edges, behind which a branch of the skeleton may lie.
const CHECKS: [[usize; 3]; LANES] = [
    [1, 1, 1],
    [1, 1, 6],
    [1, 6, 1],
    [1, 6, 6],
    [6, 1, 1],
    [6, 1, 6],
    [6, 6, 1],
    [6, 6, 6],
    [4, 4, 4],
    [4, 0, 1],
    [4, 7, 6],
    [1, 4, 0],
    [6, 4, 7],
    [0, 1, 4],
    [7, 6, 4],
    [4, 6, 1],
];

/// The root mean square error at the checks, of that of the block's density, in tolerances. Checks
/// lie where the error is largest, and the errors of blocks add up in the mean square.
const ALLOWED: f64 = 1.7;

/// Spacings, times the root of the kernel's thickness, that the boundary must be away: the density
/// varies over that root times the distance.
const RESOLVED: f64 = 1.2;

/// Which nodes of a block to compute, and how to fill in the rest.
pub(crate) struct SmoothBlock {
    /// One attempt after the other.
    pub(crate) attempts: Vec<Attempt>,
    /// Nodes (C order) that none of them computes, in compact packets.
    pub(crate) rest: Vec<[usize; LANES]>,
    /// Largest error of the interpolated distance, relative to the distance.
    crease: f32,
    /// Least distance from the boundary, in spacings.
    resolved: f64,
    /// Largest relative error at the checks.
    allowed: f32,
}

/// Interpolation from one set of knots.
pub(crate) struct Attempt {
    /// Nodes (C order) to compute before [`SmoothBlock::fill`] beside those of the attempts before,
    /// in compact packets.
    pub(crate) nodes: Vec<[usize; LANES]>,
    knots: &'static [usize],
    /// Of each knot for every place along an axis.
    weights: [Vec<f32>; EDGE],
}

impl SmoothBlock {
    /// For fields of relative L2 error `tolerance` and thickness `sigma`.
    pub(crate) fn new(tolerance: f64, sigma: f64) -> Self {
        let mut known = CHECKS.map(flat_index).to_vec();
        let mut attempts = Vec::new();
        for knots in KNOTS {
            let is_knot = |n: usize| unravel(n).iter().all(|i| knots.contains(i));
            let is_new = |n: &usize| is_knot(*n) && !known.contains(n);
            let mut new: Vec<usize> = (0..EDGE.pow(3)).filter(is_new).collect();
            known.extend(&new);
            if attempts.is_empty() {
                new.extend(CHECKS.map(flat_index));
            }
            attempts.push(Attempt {
                nodes: packets(new),
                knots,
                weights: std::array::from_fn(|place| weights(knots, place)),
            });
        }
        let others = (0..EDGE.pow(3)).filter(|n| !known.contains(n));
        Self {
            attempts,
            rest: packets(others.collect()),
            crease: (0.3 * tolerance.sqrt() * sigma) as f32,
            resolved: RESOLVED / sigma.sqrt(),
            allowed: (ALLOWED * tolerance) as f32,
        }
    }

    /// Whether a patch is such a block.
    pub(crate) fn covers(shape: [usize; 3]) -> bool {
        shape == [EDGE; 3]
    }

    /// Whether the density of a block may be smooth, by its distances: on the skeleton, where
    /// it is not, they have creases, and near the boundary they are short. Distances are known
    /// everywhere, so none is overlooked.
    pub(crate) fn is_promising(&self, distance: &[f32], spacing: f64) -> bool {
        let least = (self.resolved * spacing) as f32;
        if distance.iter().any(|d| d.abs() < least) {
            return false;
        }
        let finest = &self.attempts[KNOTS.len() - 1];
        let mut filled = [0.0; EDGE * EDGE * EDGE];
        filled.copy_from_slice(distance);
        finest.interpolate(&mut filled);
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= self.crease * b.abs();
        filled.iter().zip(distance).all(close)
    }

    /// Interpolates the density of all nodes of a block, all inside or all outside, from the knots
    /// of an attempt. False if that disagrees with the checks.
    pub(crate) fn fill(
        &self,
        attempt: &Attempt,
        density: &[Complex32],
        filled: &mut Vec<Complex32>,
    ) -> bool {
        filled.clear();
        filled.extend_from_slice(density);
        let exact = CHECKS.map(|c| filled[flat_index(c)]);
        attempt.interpolate(filled);
        let (mut error, mut size) = (0.0, 0.0);
        for (check, exact) in CHECKS.iter().zip(exact) {
            error += (filled[flat_index(*check)] - exact).norm_sqr();
            size += exact.norm_sqr();
        }
        error <= self.allowed * self.allowed * size
    }
}

impl Attempt {
    /// Replaces the values of a block by what those at the knots become there.
    fn interpolate<T: Number>(&self, values: &mut [T]) {
        // Lines between knots first, then planes, then all.
        for x in self.knots {
            let plane = &mut values[x * EDGE * EDGE..][..EDGE * EDGE];
            for y in self.knots {
                self.interpolate_line(1, &mut plane[y * EDGE..][..EDGE]);
            }
            self.interpolate_line(EDGE, plane);
        }
        self.interpolate_line(EDGE * EDGE, values);
    }

    /// The same along one axis, of whose places each has `stride` values.
    fn interpolate_line<T: Number>(&self, stride: usize, values: &mut [T]) {
        let mut sum = [T::default(); EDGE * EDGE];
        let sum = &mut sum[..stride];
        for (place, weights) in self.weights.iter().enumerate() {
            if self.knots.contains(&place) {
                continue;
            }
            sum.fill(T::default());
            for (knot, weight) in self.knots.iter().zip(weights) {
                for (sum, value) in sum.iter_mut().zip(&values[knot * stride..]) {
                    *sum += *value * *weight;
                }
            }
            values[place * stride..][..stride].copy_from_slice(sum);
        }
    }
}

/// What can be interpolated.
trait Number: Copy + Default + std::ops::AddAssign + std::ops::Mul<f32, Output = Self> {}

impl Number for f32 {}

impl Number for Complex32 {}

fn flat_index([x, y, z]: [usize; 3]) -> usize {
    (x * EDGE + y) * EDGE + z
}

fn unravel(n: usize) -> [usize; 3] {
    [n / (EDGE * EDGE), n / EDGE % EDGE, n % EDGE]
}

/// Lagrange's weights of the knots at `place`.
fn weights(knots: &[usize], place: usize) -> Vec<f32> {
    let weight = |k: &usize| {
        let others = knots.iter().filter(|j| *j != k);
        let factor = |j: &usize| (place as f64 - *j as f64) / (*k as f64 - *j as f64);
        others.map(factor).product::<f64>() as f32
    };
    knots.iter().map(weight).collect()
}

/// Nodes in packets of neighbours, the last one repeated at the end.
fn packets(mut nodes: Vec<usize>) -> Vec<[usize; LANES]> {
    nodes.sort_unstable_by_key(|n| along_curve(unravel(*n)));
    let packet = |run: &[usize]| std::array::from_fn(|lane| run[lane.min(run.len() - 1)]);
    nodes.chunks(LANES).map(packet).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(f: impl Fn([f32; 3]) -> Complex32) -> Vec<Complex32> {
        let node = |n| f(unravel(n).map(|i| i as f32 / 7.0));
        (0..EDGE.pow(3)).map(node).collect()
    }

    #[test]
    fn every_node_is_computed_once() {
        let block = SmoothBlock::new(1e-3, 0.1);
        let first = block.attempts.iter().flat_map(|a| a.nodes.concat());
        let mut nodes: Vec<usize> = first.chain(block.rest.concat()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        assert_eq!(nodes, (0..EDGE.pow(3)).collect::<Vec<_>>());
    }

    /// The result of each attempt on a density of which only the nodes it needs are known.
    fn attempts(density: &[Complex32]) -> Vec<Option<Vec<Complex32>>> {
        let smooth = SmoothBlock::new(1e-5, 0.1);
        let mut known = vec![Complex32::ZERO; density.len()];
        let attempt = |attempt: &Attempt| {
            for n in attempt.nodes.concat() {
                known[n] = density[n];
            }
            let mut filled = Vec::new();
            smooth.fill(attempt, &known, &mut filled).then_some(filled)
        };
        smooth.attempts.iter().map(attempt).collect()
    }

    #[test]
    fn polynomials_are_filled_exactly_by_the_first_attempt_that_can_and_creases_refused() {
        for degree in 2..=4 {
            let density = block(|[x, y, z]| {
                Complex32::new(
                    1.0 + x.powi(degree) - y.powi(degree - 1) * z,
                    z.powi(degree) * x * y - 2.0,
                )
            });
            let filled = attempts(&density);
            let first = degree as usize - 2;
            assert!(filled[..first].iter().all(Option::is_none));
            let filled = filled[first].as_ref().expect("smooth");
            for (n, d) in density.iter().enumerate() {
                // Of order one, in single precision, by weights that add up to a few.
                assert!((filled[n] - d).norm() < 3e-6, "{degree} {n}");
            }
        }
        let crease = block(|[x, y, _]| Complex32::new(1.0 + (x + 0.3 * y - 0.6).abs(), 0.0));
        assert!(attempts(&crease).iter().all(Option::is_none));
    }
}
