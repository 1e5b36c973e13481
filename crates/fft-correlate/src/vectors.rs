//! Shared by vector code: the instructions that `sdf-grid` chooses, transposition, inlining.

use fearless_simd::prelude::*;
use fearless_simd::{Level, SimdFloat};
use sdf_grid::level;

pub(crate) use sdf_grid::dispatch_lanes;
#[cfg(test)]
pub(crate) use sdf_grid::level::tested as levels;

/// Rows of a square of numbers as columns.
#[inline(always)]
pub(crate) fn transposed<S: Simd, V: SimdFloat<S>>(rows: [V; 4]) -> [V; 4] {
    let (a, b) = rows[0].interleave(rows[2]);
    let (c, d) = rows[1].interleave(rows[3]);
    let (e, f) = a.interleave(c);
    let (g, h) = b.interleave(d);
    [e, f, g, h]
}

/// The closure itself: attributes stand on arguments, but not yet on the right of `let`. Code that
/// is not inlined has no vector instructions.
#[inline(always)]
pub(crate) fn inlined<F>(closure: F) -> F {
    closure
}

/// The best vectors that this machine has and this crate was compiled for.
pub(crate) fn native() -> Level {
    match cfg!(test) {
        true => level::before_last().unwrap_or_else(level::native),
        false => level::native(),
    }
}
