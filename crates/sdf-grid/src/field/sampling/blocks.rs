//! Blocks of lattice arrays, and small regular patches of points, divided into packets of 2 x 2 x
//! 4.

use std::ops::Range;

use glam::DVec3;
use ndarray::{ArrayViewMut3, Axis};
use num_complex::Complex32;

use crate::field::packet::points::{LANES, Points};

/// A regular patch of `shape` points in normalized coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    pub(crate) origin: DVec3,
    pub(crate) spacing: f64,
    pub(crate) shape: [usize; 3],
}

/// Nodes whose sides are known, about some of which a patch lies.
#[derive(Debug, Clone)]
pub(crate) struct Anchors<'a> {
    pub(crate) patch: &'a Patch,
    /// Signed, normalized.
    pub(crate) distance: &'a [f32],
    /// The nodes in a row along z (C order) in whose cells the patch's points are, as many in each.
    pub(crate) cells: Range<usize>,
}

impl Patch {
    pub(crate) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    pub(crate) fn position(&self, index: [usize; 3]) -> DVec3 {
        self.origin + DVec3::from_array(index.map(|i| i as f64)) * self.spacing
    }

    pub(crate) fn flat(&self, index: [usize; 3]) -> usize {
        (index[0] * self.shape[1] + index[1]) * self.shape[2] + index[2]
    }

    pub(crate) fn unravel(&self, flat: usize) -> [usize; 3] {
        let [_, ny, nz] = self.shape;
        let line = flat / nz;
        [line / ny, line % ny, flat - line * nz]
    }

    pub(super) fn brick(&self, flat: [usize; LANES]) -> Brick {
        let points = flat.map(|f| self.position(self.unravel(f)));
        let points = Points::new(&points);
        Brick { flat, points }
    }

    /// Replaces `bricks` by those of the patch: 2 x 2 x 4 points each, the last point repeated
    /// where the patch ends.
    pub(crate) fn cut(&self, bricks: &mut Vec<Brick>) {
        bricks.clear();
        let [nx, ny, nz] = self.shape;
        let brick = |x: usize, y: usize, z: usize| {
            self.brick(std::array::from_fn(|lane| {
                self.flat([
                    (x + lane / 8).min(nx - 1),
                    (y + lane / 4 % 2).min(ny - 1),
                    (z + lane % 4).min(nz - 1),
                ])
            }))
        };
        let first = brick(0, 0, 0);
        for x in (0..nx).step_by(2) {
            for y in (0..ny).step_by(2) {
                for z in (0..nz).step_by(4) {
                    let whole = x + 2 <= nx && y + 2 <= ny && z + 4 <= nz;
                    bricks.push(if whole {
                        first.moved(self, [x, y, z])
                    } else {
                        brick(x, y, z)
                    });
                }
            }
        }
    }
}

/// Place of a point along a compact curve through patches of up to eight points per axis, below
/// 512: the bits of its three indices interleaved.
pub(crate) fn along_curve(index: [usize; 3]) -> usize {
    let bit = |b: usize, i: usize| (i >> b & 1) << (3 * b);
    let spread = |i: usize| (0..3).map(|b| bit(b, i)).sum::<usize>();
    let [x, y, z] = index.map(spread);
    4 * x + 2 * y + z
}

/// The points of one packet and their places in the patch.
#[derive(Debug, Clone)]
pub(crate) struct Brick {
    pub(crate) flat: [usize; LANES],
    pub(crate) points: Points,
}

impl Brick {
    /// The same points `by` steps further on.
    fn moved(&self, patch: &Patch, by: [usize; 3]) -> Self {
        let flat = patch.flat(by);
        let mut moved = self.clone();
        moved.flat = self.flat.map(|f| f + flat);
        moved.points.centre += patch.position(by) - patch.origin;
        moved
    }
}

/// Nodes along each edge of a block, the unit of work.
const BLOCK: usize = 8;

/// The values of a field, to be filled.
pub(crate) struct Arrays<'a> {
    /// As [`crate::DensityField::exterior`].
    pub(crate) exterior: ArrayViewMut3<'a, Complex32>,
    /// As [`crate::DensityField::interior`].
    pub(crate) interior: ArrayViewMut3<'a, Complex32>,
    /// As [`crate::DensityField::signed_distance`].
    pub(crate) signed_distance: ArrayViewMut3<'a, f32>,
}

/// A block of the field's arrays and where it starts.
pub(super) struct Block<'a> {
    pub(super) start: [usize; 3],
    pub(super) exterior: ArrayViewMut3<'a, Complex32>,
    pub(super) interior: ArrayViewMut3<'a, Complex32>,
    pub(super) signed_distance: ArrayViewMut3<'a, f32>,
}

/// How many blocks arrays of a shape are cut into.
pub(super) fn block_count(shape: [usize; 3]) -> u64 {
    shape
        .map(|n| n.div_ceil(BLOCK) as u64)
        .into_iter()
        .product()
}

/// The arrays cut into blocks.
pub(super) fn blocks(arrays: Arrays<'_>) -> Vec<Block<'_>> {
    let exterior = cut(arrays.exterior);
    let interior = cut(arrays.interior);
    let distance = cut(arrays.signed_distance);
    let parts = exterior.into_iter().zip(interior).zip(distance);
    parts
        .map(
            |(((start, exterior), (_, interior)), (_, signed_distance))| Block {
                start,
                exterior,
                interior,
                signed_distance,
            },
        )
        .collect()
}

/// Disjoint views of at most [`BLOCK`] nodes per axis, each with the index it starts at.
pub(super) fn cut<T>(view: ArrayViewMut3<'_, T>) -> Vec<([usize; 3], ArrayViewMut3<'_, T>)> {
    (0..3).fold(vec![([0; 3], view)], |parts, axis| {
        let slices = |(start, view)| cut_axis(start, view, axis);
        parts.into_iter().flat_map(slices).collect()
    })
}

fn cut_axis<T>(
    mut start: [usize; 3],
    mut rest: ArrayViewMut3<'_, T>,
    axis: usize,
) -> Vec<([usize; 3], ArrayViewMut3<'_, T>)> {
    let mut parts = Vec::new();
    while rest.len_of(Axis(axis)) > BLOCK {
        let (head, tail) = rest.split_at(Axis(axis), BLOCK);
        parts.push((start, head));
        start[axis] += BLOCK;
        rest = tail;
    }
    parts.push((start, rest));
    parts
}
