//! Elementary functions for sixteen points.

use fearless_simd::{f32x16, i32x16, prelude::*};

/// Points at a time.
pub(super) const LANES: usize = 16;

/// One number per point.
pub(super) type Lanes = [f32; LANES];

/// The natural logarithm of a positive normal number to about 2e-7.
#[inline(always)]
pub(super) fn ln<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    let simd = x.token();
    // The mantissa from sqrt(1/2) on, and the exponent that goes with it.
    const HALF: i32 = 0x3f35_04f3;
    let bits: i32x16<S> = x.bitcast();
    let exponent = (bits - HALF) >> 23;
    let mantissa: f32x16<S> = (bits - (exponent << 23)).bitcast();
    let f = mantissa - 1.0;
    let mut p = f32x16::splat(simd, 7.037_683_6e-2);
    for c in [
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_7e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        0.333_333_3,
        -0.5,
    ] {
        p = p.mul_add(f, f32x16::splat(simd, c));
    }
    let whole: f32x16<S> = exponent.to_float();
    whole.mul_add(
        f32x16::splat(simd, std::f32::consts::LN_2),
        (p * f).mul_add(f, f),
    )
}
