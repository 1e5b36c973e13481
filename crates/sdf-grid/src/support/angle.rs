//! Angles for sixteen points.

use fearless_simd::{f32x16, prelude::*};

/// The angle of `(x, y)` with `y` not negative, to about 1e-6, in `0 ..= pi`; zero at the origin.
#[inline(always)]
pub(crate) fn upper_angle<S: Simd>(y: f32x16<S>, x: f32x16<S>) -> f32x16<S> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let simd = x.token();
    let ax = x.abs();
    let z = ax.min(y) / ax.max(y).max(1e-37);
    let s = z * z;
    let mut p = f32x16::splat(simd, -0.004_054_058);
    for c in [
        0.021_861_23,
        -0.055_909_887,
        0.096_420_04,
        -0.139_085_33,
        0.199_465_36,
        -0.333_298_56,
        0.999_999_35,
    ] {
        p = p.mul_add(s, f32x16::splat(simd, c));
    }
    let angle = p * z;
    let angle = ax.simd_lt(y).select(FRAC_PI_2 - angle, angle);
    x.simd_lt(0.0).select(PI - angle, angle)
}
