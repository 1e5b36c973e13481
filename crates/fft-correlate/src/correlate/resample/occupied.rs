//! Which blocks of a field hold anything, so that empty space is skipped.

use glam::DVec3;
use ndarray::{Array3, Axis};
use num_complex::Complex;

use crate::correlate::real::Real;
use crate::pair::reading::Reading;

/// Nodes along each side of the blocks whose emptiness is known.
const BLOCK: f64 = 4.0;

/// Samples along z that are taken or skipped together, for all lanes of y.
pub(super) const PATCH: usize = 8;

/// Where a field may be nonzero within reach of a patch of samples.
pub(super) struct Occupied {
    /// Whether a patch with its middle in this block of [`BLOCK`] cells may see anything.
    blocks: Array3<bool>,
    /// Blocks before the one that holds node 0.
    before: f64,
}

impl Occupied {
    /// For patches of `lanes` times [`PATCH`] samples one cell apart.
    pub(super) fn new<T: Real>(
        values: &Array3<Complex<T>>,
        lanes: usize,
        reading: Reading,
    ) -> Self {
        let half = |n: usize| (n as f64 - 1.0) / 2.0;
        // From the middle to the farthest sample, and on to the farthest node that it reads.
        let reach = half(lanes).hypot(half(PATCH)) + 3f64.sqrt() * reading.reach();
        let before = (reach / BLOCK).ceil() as usize;
        let shape = values.dim();
        let count = |n: usize| n.div_ceil(BLOCK as usize) + 2 * before;
        let mut blocks = Array3::from_elem([count(shape.0), count(shape.1), count(shape.2)], false);
        for ((i, j, k), v) in values.indexed_iter() {
            if *v != Complex::default() {
                blocks[[i, j, k].map(|n| n / BLOCK as usize + before)] = true;
            }
        }
        for axis in 0..3 {
            for mut lane in blocks.lanes_mut(Axis(axis)) {
                let line = lane.to_vec();
                for (i, v) in lane.iter_mut().enumerate() {
                    let near = i.saturating_sub(before)..(i + before + 1).min(line.len());
                    *v = line[near].contains(&true);
                }
            }
        }
        let before = before as f64;
        Self { blocks, before }
    }

    /// Whether a patch with its middle at this index may see anything.
    pub(super) fn near(&self, middle: DVec3) -> bool {
        let at = (middle / BLOCK + self.before).floor();
        at.min_element() >= 0.0
            && self
                .blocks
                .get(at.to_array().map(|c| c as usize))
                .is_some_and(|v| *v)
    }
}
