//! The arrays of a field cut into blocks.

use ndarray::{ArrayViewMut3, Axis};
use num_complex::Complex32;

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
