//! Where spectra and scratch of the fused correlation lie in memory.

use std::ops::Range;

use fearless_simd::Level;
use fearless_simd::prelude::*;

use crate::correlate::contract::Sizes;
use crate::correlate::real::Real;
use crate::vectors::dispatch_lanes;

/// The largest number of terms of one sum.
pub(super) const MAX_TERMS: usize = 2;

/// Numbers by which rows are apart beyond their length, so that equal places of many rows do not
/// fall into the same few cache sets.
const PAD: usize = 16;

/// Numbers that neighbouring y share in one visit of a plane: 1 KiB of f32.
const CHUNK: usize = 256;

/// x planes that are sampled before the first of them is transformed: what the next plane reads of
/// the field is then still in the second-level cache.
pub(super) const PLANES: usize = 8;

/// Where things lie.
///
/// Between the z and the y transforms the lines of a term along y are `[kz block][part][x]`; after
/// them one kz block at a time is `[part][y chunk][x][y in chunk]`, so that neither y lines nor x
/// lines lie at strides that fall into few cache sets. Each element is real and imaginary lanes of
/// kz. Behind the x planes of a block lie two more: one that is always zero, read for planes that
/// hold nothing, and one that takes what is not wanted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(super) lanes: usize,
    /// Points of the complex z transforms, and blocks of lanes of kz.
    pub(super) half: usize,
    pub(super) blocks: usize,
    /// y in one chunk, a power of two as its binary logarithm; and chunks.
    pub(super) chunk_bits: u32,
    chunks: usize,
    /// From x to x within a chunk.
    pub(super) x_stride: usize,
    /// From bundle to bundle of y rows in a transformed plane.
    pub(super) row: usize,
    /// From line to line along y before the y transforms, and the elements there is room for.
    pub(super) line: usize,
    pub(super) line_elements: usize,
}

impl Layout {
    pub(super) fn new(sizes: &Sizes, lanes: usize) -> Self {
        let size = sizes.transform;
        // Elements of y lines that are read or wanted.
        let line = match halves(sizes, 1) {
            (true, true) => size[1] / 2,
            _ => size[1],
        };
        let half = size[2] / 2;
        let blocks = half.div_ceil(lanes);
        // A last bundle of rows may reach beyond the end.
        let line_elements = (line + lanes).next_multiple_of(lanes);
        let chunk_bits = (CHUNK / (2 * lanes)).ilog2();
        Self {
            lanes,
            half,
            blocks,
            chunk_bits,
            chunks: size[1].div_ceil(1 << chunk_bits),
            x_stride: CHUNK + PAD,
            row: blocks * lanes * 2 * lanes + PAD,
            line: line_elements * 2 * lanes + PAD,
            line_elements,
        }
    }

    /// Numbers of one kz block of the half spectra of a term with this many x planes.
    pub(super) fn block(&self, planes: usize) -> usize {
        2 * self.chunks * self.chunk(planes)
    }

    /// Numbers of all lines along y of such a term.
    pub(super) fn lines(&self, planes: usize) -> usize {
        self.line(planes, self.blocks, 0, 0)
    }

    /// Offset of one of them.
    pub(super) fn line(&self, planes: usize, block: usize, part: usize, x: usize) -> usize {
        ((block * 2 + part) * planes + x) * self.line
    }

    pub(super) fn chunk(&self, planes: usize) -> usize {
        (planes + 2) * self.x_stride
    }

    /// Where the elements of a y line begin.
    pub(super) fn y_places(&self, planes: usize, ny: usize) -> Vec<usize> {
        (0..ny).map(|y| self.column(planes, 0, y)).collect()
    }

    /// Where an element of an x line begins: of a plane that is there, or of the zero plane.
    pub(super) fn x_from(&self, planes: usize, filled: &Range<usize>, x: usize) -> usize {
        let plane = if filled.contains(&x) { x } else { planes };
        plane * self.x_stride
    }

    /// The same for writing: of a wanted plane, or of the one for what is not.
    pub(super) fn x_to(&self, planes: usize, wanted: Option<usize>) -> usize {
        wanted.unwrap_or(planes + 1) * self.x_stride
    }

    /// Where an element of a line along y begins for writing: a wanted one, or one that is never
    /// read.
    pub(super) fn y_to(&self, wanted: Option<usize>) -> usize {
        wanted.unwrap_or(self.line_elements - 1) * 2 * self.lanes
    }

    /// Offset of the element at x = 0 in a column of a block.
    pub(super) fn column(&self, planes: usize, part: usize, y: usize) -> usize {
        let chunk = part * self.chunks + (y >> self.chunk_bits);
        chunk * self.chunk(planes) + (y & ((1 << self.chunk_bits) - 1)) * 2 * self.lanes
    }

    /// Numbers of the fixed spectra of one term.
    pub(super) fn spectrum(&self, [nx, ny, _]: [usize; 3]) -> usize {
        self.blocks * ny * nx * 4 * self.lanes
    }

    /// Memory for one plane or column.
    pub(super) fn plane(&self, sizes: &Sizes) -> PlaneSizes {
        let [nx, ny, _] = sizes.transform;
        let longest_row = sizes
            .moving
            .iter()
            .map(|s| s[2])
            .fold(self.half, usize::max);
        let longest = nx.max(ny).max(self.half);
        PlaneSizes {
            bundles: PLANES * self.bundles(ny),
            bundle: (longest_row * 2 * self.lanes + PAD).next_multiple_of(PAD),
            plane: 2 * self.bundles(ny) * self.row,
            tile: (longest + self.lanes) * 2 * self.lanes,
        }
    }

    /// Bundles that hold `rows` rows.
    pub(super) fn bundles(&self, rows: usize) -> usize {
        rows.div_ceil(self.lanes)
    }
}

/// Whether all moving parts, and the window, fill no more than half of an axis.
pub(super) fn halves(sizes: &Sizes, axis: usize) -> (bool, bool) {
    let half = sizes.transform[axis] / 2;
    let from_half = sizes.moving.iter().all(|s| s[axis] <= half);
    (from_half, sizes.window[axis] <= half)
}

/// x planes of a term's half spectra: the first term's also take the sum of all.
pub(super) fn planes(sizes: &Sizes, term: usize) -> usize {
    let own = sizes.moving[term][0];
    if term == 0 {
        own.max(sizes.window[0])
    } else {
        own
    }
}

/// Memory for one plane or column, in numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneSizes {
    /// Bundles of [`PLANES`] moving planes, and numbers in each.
    pub(super) bundles: usize,
    pub(super) bundle: usize,
    /// A plane between its transforms.
    pub(super) plane: usize,
    /// A line.
    pub(super) tile: usize,
}

/// Lanes of this machine's vectors of `T`.
pub(crate) fn lanes<T: Real>(level: Level) -> usize {
    dispatch_lanes!(level, simd => lanes_of::<_, T>(simd))
}

#[inline(always)]
fn lanes_of<S: Simd, T: Real>(_: S) -> usize {
    T::Native::<S>::LEN
}
