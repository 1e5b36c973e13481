//! What vector code shares.

use fearless_simd::{SimdFloat, prelude::*};

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
