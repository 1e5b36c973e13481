//! Elementary functions for sixteen points.

use fearless_simd::{f32x16, i32x16, prelude::*};

/// Points at a time.
pub(super) const LANES: usize = 16;

/// One number per point.
pub(super) type Lanes = [f32; LANES];

/// Half the natural logarithm of a positive normal number to about 1e-6.
#[inline(always)]
pub(super) fn half_ln<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    let simd = x.token();
    // The mantissa from sqrt(1/2) on, and the exponent that goes with it.
    const HALF: i32 = 0x3f35_04f3;
    let bits: i32x16<S> = x.bitcast();
    let exponent = (bits - HALF) >> 23;
    let mantissa: f32x16<S> = (bits - (exponent << 23)).bitcast();
    let f = mantissa - 1.0;
    // `(ln (1 + f) - f) / 2 f²`, least maximum of what it errs in that.
    let mut p = f32x16::splat(simd, -0.070_532_23);
    for c in [0.110_353_7, -0.127_294_16, 0.166_311_81, -0.249_937_54] {
        p = p.mul_add(f, f32x16::splat(simd, c));
    }
    let whole: f32x16<S> = exponent.to_float();
    whole.mul_add(0.5 * std::f32::consts::LN_2, (p * f).mul_add(f, f * 0.5))
}

/// The angle of `(x, y)` with `y` not negative, to about 2e-6, in `0 ..= pi`; zero at the origin.
#[inline(always)]
pub(super) fn coarse_angle<S: Simd>(y: f32x16<S>, x: f32x16<S>) -> f32x16<S> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let simd = x.token();
    let ax = x.abs();
    let z = ax.min(y) / ax.max(y).max(1e-37);
    let s = z * z;
    let mut p = f32x16::splat(simd, -0.011_719_138);
    for c in [
        0.052_647_36,
        -0.116_426_49,
        0.193_540_38,
        -0.332_622_83,
        0.999_977_2,
    ] {
        p = p.mul_add(s, f32x16::splat(simd, c));
    }
    let angle = p * z;
    let angle = ax.simd_lt(y).select(FRAC_PI_2 - angle, angle);
    x.simd_lt(0.0).select(PI - angle, angle)
}
