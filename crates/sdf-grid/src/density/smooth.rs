//! Smooth blocks: where values interpolated between some nodes agree with others that were computed,
//! the rest are interpolated too.
//!
//! Away from the skeleton and from the reach of edges the density varies over lengths of the order of
//! the distance from the boundary, many nodes on a fine lattice.

use num_complex::Complex64;

use super::fast::LANES;
use super::reference::UnitDensity;

/// Nodes along each edge of a block.
const EDGE: usize = 8;

/// Nodes per axis that are computed in every block.
const KNOTS: [usize; 5] = [0, 2, 3, 5, 7];

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
const ALLOWED: f64 = 1.5;

/// Spacings, times the root of the kernel's thickness, that the boundary must be away: the density varies
/// over that root times the distance.
const RESOLVED: f64 = 1.2;

/// Which nodes of a block to compute first, and how to fill in the rest.
pub(crate) struct SmoothBlock {
    /// Nodes (C order) to compute before [`SmoothBlock::fill`], in compact packets.
    pub(crate) first: Vec<[usize; LANES]>,
    /// The others.
    pub(crate) rest: Vec<[usize; LANES]>,
    /// Of each knot for every other place along an axis.
    weights: Vec<(usize, [f64; KNOTS.len()])>,
    /// Largest error of the interpolated distance, relative to the distance.
    crease: f64,
    /// Least distance from the boundary, in spacings.
    resolved: f64,
    /// Largest relative error at the checks.
    allowed: f64,
}

impl SmoothBlock {
    /// For fields of relative L2 error `tolerance` and thickness `sigma`.
    pub(crate) fn new(tolerance: f64, sigma: f64) -> Self {
        let checks = CHECKS.map(flat);
        let is_knot = |n: usize| place(n).iter().all(|i| KNOTS.contains(i));
        let knots = (0..EDGE.pow(3)).filter(|n| is_knot(*n));
        let others = (0..EDGE.pow(3)).filter(|n| !is_knot(*n) && !checks.contains(n));
        let mut first = packets(knots.collect());
        first.push(checks);
        Self {
            first,
            rest: packets(others.collect()),
            weights: (0..EDGE)
                .filter(|k| !KNOTS.contains(k))
                .map(|k| (k, weights(k)))
                .collect(),
            crease: 0.3 * tolerance.sqrt() * sigma,
            resolved: RESOLVED / sigma.sqrt(),
            allowed: ALLOWED * tolerance,
        }
    }

    /// Whether a patch is such a block.
    pub(crate) fn covers(shape: [usize; 3]) -> bool {
        shape == [EDGE; 3]
    }

    /// Whether the distances of a block tell that its density may be smooth: on the skeleton, where
    /// it is not, they have creases, and near the boundary they are short. Distances are known everywhere, so none is overlooked.
    pub(crate) fn promises(&self, distance: &[f32], spacing: f64) -> bool {
        let least = (self.resolved * spacing) as f32;
        if distance.iter().any(|d| d.abs() < least) {
            return false;
        }
        let filled = self.interpolated(|n| f64::from(distance[n]));
        let close = |(a, b): (&f64, &f32)| {
            let b = f64::from(*b);
            (a - b).abs() <= self.crease * b.abs()
        };
        filled.iter().zip(distance).all(close)
    }

    /// Interpolates the density of all nodes of a block, all inside or all outside, from its knots.
    /// None if that disagrees with the checks.
    pub(crate) fn fill(&self, density: &[UnitDensity]) -> Option<[Complex64; EDGE * EDGE * EDGE]> {
        let value = |n: usize| density[n].combined(1.0, 1.0);
        let filled = self.interpolated(value);
        let (mut error, mut size) = (0.0, 0.0);
        for n in CHECKS.map(flat) {
            error += (filled[n] - value(n)).norm_sqr();
            size += value(n).norm_sqr();
        }
        (error <= self.allowed * self.allowed * size).then_some(filled)
    }

    /// What the values at the knots become at all nodes of a block.
    fn interpolated<T>(&self, value: impl Fn(usize) -> T) -> [T; EDGE * EDGE * EDGE]
    where
        T: Copy + std::ops::Mul<f64, Output = T> + std::iter::Sum,
    {
        let mut filled = std::array::from_fn(value);
        // Axis by axis: lines between knots first, then planes, then all.
        for axis in 0..3 {
            let known = |a: usize| if a < axis { &ALL[..] } else { &KNOTS[..] };
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let mut strides = [EDGE * EDGE, EDGE, 1];
            strides.rotate_left(axis);
            for &i in known(u) {
                for &j in known(v) {
                    let at = |k: usize| k * strides[0] + i * strides[1] + j * strides[2];
                    let line = KNOTS.map(|k| filled[at(k)]);
                    for (k, weights) in &self.weights {
                        let terms = weights.iter().zip(&line).map(|(w, z)| *z * *w);
                        filled[at(*k)] = terms.sum();
                    }
                }
            }
        }
        filled
    }
}

const ALL: [usize; EDGE] = [0, 1, 2, 3, 4, 5, 6, 7];

fn flat([x, y, z]: [usize; 3]) -> usize {
    (x * EDGE + y) * EDGE + z
}

fn place(n: usize) -> [usize; 3] {
    [n / (EDGE * EDGE), n / EDGE % EDGE, n % EDGE]
}

/// Lagrange's weights of the knots at `place`.
fn weights(place: usize) -> [f64; KNOTS.len()] {
    KNOTS.map(|k| {
        let others = KNOTS.iter().filter(|j| **j != k);
        let factor = |j: &usize| (place as f64 - *j as f64) / (k as f64 - *j as f64);
        others.map(factor).product()
    })
}

/// Nodes in packets of neighbours, the last one repeated at the end.
fn packets(mut nodes: Vec<usize>) -> Vec<[usize; LANES]> {
    // Bits of the three indices interleaved: runs are compact.
    let key = |n: &usize| {
        let bit = |b: usize, i: usize| (i >> b & 1) << (3 * b);
        let spread = |i: usize| (0..3).map(|b| bit(b, i)).sum::<usize>();
        let [x, y, z] = place(*n).map(spread);
        4 * x + 2 * y + z
    };
    nodes.sort_unstable_by_key(key);
    let packet = |run: &[usize]| std::array::from_fn(|lane| run[lane.min(run.len() - 1)]);
    nodes.chunks(LANES).map(packet).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(f: impl Fn([f64; 3]) -> Complex64) -> Vec<UnitDensity> {
        let node = |n| UnitDensity {
            exterior: f(place(n).map(|i| i as f64 / 7.0)),
            interior: Complex64::ZERO,
        };
        (0..EDGE.pow(3)).map(node).collect()
    }

    #[test]
    fn every_node_is_computed_once() {
        let block = SmoothBlock::new(1e-3, 0.1);
        let mut nodes: Vec<usize> = block.first.concat();
        nodes.extend(block.rest.concat());
        nodes.sort_unstable();
        nodes.dedup();
        assert_eq!(nodes, (0..EDGE.pow(3)).collect::<Vec<_>>());
    }

    #[test]
    fn quartic_densities_are_filled_exactly_and_creases_refused() {
        let quartic = |[x, y, z]: [f64; 3]| {
            Complex64::new(1.0 + x.powi(4) - y.powi(3) * z, z.powi(4) * x * y - 2.0)
        };
        let density = block(quartic);
        let smooth = SmoothBlock::new(1e-5, 0.1);
        let mut known = vec![UnitDensity::default(); density.len()];
        for n in smooth.first.concat() {
            known[n] = density[n];
        }
        let filled = smooth.fill(&known).expect("smooth");
        for (n, d) in density.iter().enumerate() {
            // Of order one, in f64.
            assert!((filled[n] - d.exterior).norm() < 1e-12, "{n}");
        }
        let crease = block(|[x, y, _]| Complex64::new(1.0 + (x + 0.3 * y - 0.6).abs(), 0.0));
        assert!(smooth.fill(&crease).is_none());
    }
}
