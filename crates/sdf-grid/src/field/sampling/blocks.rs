//! Blocks of lattice arrays, and small regular patches of points, divided into packets of 2 x 2 x
//! 4.

use std::ops::Range;

use glam::DVec3;
use ndarray::{ArrayViewMut3, Axis};
use num_complex::Complex32;

use crate::field::lattice::Lattice;
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
pub(super) const BLOCK: usize = 8;

/// All nodes of a spacing, by whole numbers, however far. Blocks begin at multiples of [`BLOCK`], so
/// that values do not depend on which box of nodes is computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Position of node zero, metres.
    zero: DVec3,
    pub(super) spacing: f64,
}

/// A box of a grid's nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Region {
    pub(super) first: [i64; 3],
    pub(super) shape: [usize; 3],
}

/// Nodes farther from the frame's origin than this many spacings are counted from the lattice's own.
const FARTHEST: f64 = 1e12;

/// Origins that differ by less than this many spacings are the same.
const ROUNDING: f64 = 1e-6;

impl Grid {
    /// The grid of a lattice, and which nodes the lattice has. That of [`Lattice::covering`] depends on
    /// the spacing alone.
    pub(super) fn of(lattice: &Lattice) -> (Self, Region) {
        let spacing = lattice.spacing();
        let count = (lattice.origin() / spacing - 0.5).round();
        let count = if count.abs().max_element() < FARTHEST {
            count
        } else {
            DVec3::ZERO
        };
        // Rounding of the origin counts for nothing, so that lattices cut from one are of its grid.
        let rest = lattice.origin() - (count + 0.5) * spacing;
        let rest = if rest.abs().max_element() < ROUNDING * spacing {
            DVec3::ZERO
        } else {
            rest
        };
        let grid = Self {
            zero: 0.5 * spacing + rest,
            spacing,
        };
        let region = Region {
            first: count.to_array().map(|c| c as i64),
            shape: lattice.shape(),
        };
        (grid, region)
    }

    /// The grid of half the spacing: its node `2 n` is node `n` of this one.
    pub(super) fn finer(&self) -> Self {
        Self {
            spacing: 0.5 * self.spacing,
            ..*self
        }
    }

    pub(super) fn position(&self, index: [i64; 3]) -> DVec3 {
        self.zero + self.spacing * DVec3::from_array(index.map(|i| i as f64))
    }
}

impl Region {
    /// From one node to another, both included.
    pub(super) fn between(first: [i64; 3], last: [i64; 3]) -> Self {
        let shape = std::array::from_fn(|a| (last[a] - first[a] + 1) as usize);
        Self { first, shape }
    }

    /// The blocks in which its nodes are.
    pub(super) fn in_blocks(&self) -> Self {
        let block = BLOCK as i64;
        let first = self.first.map(|n| n.div_euclid(block) * block);
        let last = self.last().map(|n| (n.div_euclid(block) + 1) * block - 1);
        Self::between(first, last)
    }

    /// Its last node.
    pub(super) fn last(&self) -> [i64; 3] {
        std::array::from_fn(|a| self.first[a] + self.shape[a] as i64 - 1)
    }

    /// How many blocks it is cut into.
    pub(super) fn block_count(&self) -> u64 {
        let blocks = self.in_blocks().shape.map(|n| (n / BLOCK) as u64);
        blocks.into_iter().product()
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> u64 {
        let nodes = self.shape.iter();
        nodes.fold(1, |n: u64, s| n.saturating_mul(*s as u64))
    }
}

/// The values of a field, to be filled.
pub(crate) struct Arrays<'a> {
    /// As [`crate::DensityField::exterior`].
    pub(crate) exterior: ArrayViewMut3<'a, Complex32>,
    /// As [`crate::DensityField::interior`].
    pub(crate) interior: ArrayViewMut3<'a, Complex32>,
    /// As [`crate::DensityField::signed_distance`].
    pub(crate) signed_distance: ArrayViewMut3<'a, f32>,
}

/// Where a block lies, and which of its nodes an array has.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Its first node.
    pub(super) corner: [i64; 3],
    /// From there to the first node of the array.
    pub(super) offset: [usize; 3],
}

/// The part of the field's arrays in a block.
pub(super) struct Block<'a> {
    pub(super) place: Place,
    pub(super) exterior: ArrayViewMut3<'a, Complex32>,
    pub(super) interior: ArrayViewMut3<'a, Complex32>,
    pub(super) signed_distance: ArrayViewMut3<'a, f32>,
}

/// The arrays cut into blocks; they begin at node `first`.
pub(super) fn blocks(arrays: Arrays<'_>, first: [i64; 3]) -> Vec<Block<'_>> {
    let exterior = cut(arrays.exterior, first);
    let interior = cut(arrays.interior, first);
    let distance = cut(arrays.signed_distance, first);
    let parts = exterior.into_iter().zip(interior).zip(distance);
    parts
        .map(
            |(((place, exterior), (_, interior)), (_, signed_distance))| Block {
                place,
                exterior,
                interior,
                signed_distance,
            },
        )
        .collect()
}

/// Disjoint views of the nodes of each block of an array that begins at node `first`.
pub(super) fn cut<T>(
    view: ArrayViewMut3<'_, T>,
    first: [i64; 3],
) -> Vec<(Place, ArrayViewMut3<'_, T>)> {
    let block = BLOCK as i64;
    let whole = Place {
        corner: first.map(|n| n.div_euclid(block) * block),
        offset: first.map(|n| n.rem_euclid(block) as usize),
    };
    (0..3).fold(vec![(whole, view)], |parts, axis| {
        let slices = |(place, view)| cut_axis(place, view, axis);
        parts.into_iter().flat_map(slices).collect()
    })
}

fn cut_axis<T>(
    mut place: Place,
    mut rest: ArrayViewMut3<'_, T>,
    axis: usize,
) -> Vec<(Place, ArrayViewMut3<'_, T>)> {
    let mut parts = Vec::new();
    while place.offset[axis] + rest.len_of(Axis(axis)) > BLOCK {
        let (head, tail) = rest.split_at(Axis(axis), BLOCK - place.offset[axis]);
        parts.push((place, head));
        place.corner[axis] += BLOCK as i64;
        place.offset[axis] = 0;
        rest = tail;
    }
    parts.push((place, rest));
    parts
}
