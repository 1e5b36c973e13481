//! The smoothed kernel over a plane, for sixteen samples at a time, and the arithmetic that it
//! needs.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, i32x16};
use glam::{Mat3, Vec3};

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

/// One vector per sample.
pub(super) type Vectors<S> = [f32x16<S>; 3];

#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, value: f32) -> f32x16<S> {
    f32x16::splat(simd, value)
}

/// Components along three axes.
#[inline(always)]
pub(super) fn components<S: Simd>(of: &Vectors<S>, axes: &[Vec3; 3]) -> Vectors<S> {
    [dot(of, axes[0]), dot(of, axes[1]), dot(of, axes[2])]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(a: &Vectors<S>, b: Vec3) -> f32x16<S> {
    let simd = a[0].token();
    let z = a[2] * b.z;
    a[0].mul_add(splat(simd, b.x), a[1].mul_add(splat(simd, b.y), z))
}

#[inline(always)]
pub(super) fn inner<S: Simd>(a: &Vectors<S>, b: &Vectors<S>) -> f32x16<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(super) fn scaled<S: Simd>(a: &Vectors<S>, by: f32x16<S>) -> Vectors<S> {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
pub(super) fn turned<S: Simd>(simd: S, turn: &Mat3, v: &[Lanes; 3]) -> Vectors<S> {
    let v = [
        f32x16::simd_from(simd, v[0]),
        f32x16::simd_from(simd, v[1]),
        f32x16::simd_from(simd, v[2]),
    ];
    [
        dot(&v, turn.row(0)),
        dot(&v, turn.row(1)),
        dot(&v, turn.row(2)),
    ]
}

/// Lengths of the fast sum are in units of the kernel's reach, which is this many widths. Of the
/// kernel's integral over a plane 1.6e-3 is left there, which the polynomial takes to zero.
pub(super) const REACH: f64 = 3.75;

/// Terms of the polynomial.
const TERMS: usize = 8;

/// `κ` of the kernel's integral over a plane ([`crate::contact`]) as a polynomial of the squared
/// distance, both in units of the reach. Value and slope of `K` vanish there; its slope is off by
/// 6e-4 at most and its value by 1.1e-3 of the greatest. Least squares of both, reweighted to the
/// least maximum.
const ENTIRE: [f32; TERMS] = [
    0.053_250_687,
    1.117_901_8,
    -2.111_371,
    3.702_628_8,
    -4.535_737,
    3.549_470_3,
    -1.575_554_6,
    0.299_411_26,
];

/// `κ'` in the same way.
const SLOPES: [f32; TERMS - 1] = derivative(&ENTIRE, 1.0);

/// So many times the derivative of a polynomial of one term more.
const fn derivative<const N: usize, const M: usize>(of: &[f32; N], times: f32) -> [f32; M] {
    let mut slopes = [0.0; M];
    let mut n = 0;
    while n < M {
        slopes[n] = times * (n + 1) as f32 * of[n + 1];
        n += 1;
    }
    slopes
}

/// The second derivative with the height of the integral over a plane, without its spike on it, as
/// a polynomial of the squared height: off by 0.6 % of its greatest at most, one in all as the
/// spike takes, and smoothly zero at the reach. Least squares under these conditions, reweighted to
/// the least maximum.
const SECOND: [f32; TERMS - 1] = [
    2.230_485,
    -24.939_982,
    106.155_67,
    -232.520_66,
    277.905_66,
    -171.555_02,
    42.723_846,
];

/// Its slope over the height.
const THIRD: [f32; TERMS - 2] = derivative(&SECOND, 2.0);

/// Both at a squared height, at most one.
#[inline(always)]
pub(super) fn curvature<S: Simd>(t: f32x16<S>) -> [f32x16<S>; 2] {
    [polynomial(t, &SECOND), polynomial(t, &THIRD)]
}

#[inline(always)]
fn polynomial<S: Simd, const N: usize>(t: f32x16<S>, of: &[f32; N]) -> f32x16<S> {
    let simd = t.token();
    let mut sum = splat(simd, of[N - 1]);
    for c in of[..N - 1].iter().rev() {
        sum = sum.mul_add(t, splat(simd, *c));
    }
    sum
}

/// `κ` about a squared height `t`: what Horner's scheme passes on its way,
/// `(κ(r) - κ(t)) / (r - t) = Σ e_i r^i`, and the same of `κ'`, which is the slope of that with `t`
/// where `r - t` stays.
pub(super) struct Quotients<S: Simd> {
    pub(super) value: f32x16<S>,
    pub(super) slope: f32x16<S>,
    of_value: [f32x16<S>; TERMS - 1],
    of_slope: [f32x16<S>; TERMS - 2],
}

impl<S: Simd> Quotients<S> {
    /// About `t`, at most one.
    #[inline(always)]
    pub(super) fn expand_at(t: f32x16<S>) -> Self {
        let (value, of_value) = horner(t, &ENTIRE);
        let (slope, of_slope) = horner(t, &SLOPES);
        Self {
            value,
            slope,
            of_value,
            of_slope,
        }
    }

    /// `∫ (κ(r) - κ(t)) / (r - t) dl`, its slope with `t`, and twice `∫ κ'(r) dl`, where
    /// `r = near + l²`, from `a` to `b`, where `r` is as given.
    #[inline(always)]
    pub(super) fn integrate(
        &self,
        near: f32x16<S>,
        [a, b]: [f32x16<S>; 2],
        [ra, rb]: [f32x16<S>; 2],
    ) -> [f32x16<S>; 3] {
        let (mut ta, mut tb) = (a, b);
        self.sums(
            near,
            b - a,
            #[inline(always)]
            || {
                ta *= ra;
                tb *= rb;
                tb - ta
            },
        )
    }

    /// The same from where `r` is one to where it is one again, so far to either side.
    #[inline(always)]
    pub(super) fn integrate_chord(&self, near: f32x16<S>, side: f32x16<S>) -> [f32x16<S>; 3] {
        let length = side + side;
        self.sums(
            near,
            length,
            #[inline(always)]
            || length,
        )
    }

    /// The sums over moments,
    /// `moment_k = ∫ r^k dl = ([l r^k] + 2 k near moment_(k - 1)) / (2 k + 1)`. `ends` gives the
    /// bracketed terms for k from 1 on.
    #[inline(always)]
    fn sums(
        &self,
        near: f32x16<S>,
        length: f32x16<S>,
        mut ends: impl FnMut() -> f32x16<S>,
    ) -> [f32x16<S>; 3] {
        let mut moment = length;
        let mut sums = [
            self.of_value[0] * moment,
            self.of_slope[0] * moment,
            moment * (2.0 * SLOPES[0]),
        ];
        #[expect(clippy::needless_range_loop, reason = "iterators take 3 % longer")]
        for k in 1..TERMS - 1 {
            let odd = 1.0 / (2 * k + 1) as f32;
            let before = near * (moment * (2.0 * k as f32 * odd));
            moment = ends().mul_add(odd, before);
            sums[0] = self.of_value[k].mul_add(moment, sums[0]);
            if k + 2 < TERMS {
                sums[1] = self.of_slope[k].mul_add(moment, sums[1]);
            }
            sums[2] = moment.mul_add(2.0 * SLOPES[k], sums[2]);
        }
        sums
    }
}

/// A polynomial at `t`, and what is passed on the way there.
#[inline(always)]
fn horner<S: Simd, const N: usize, const M: usize>(
    t: f32x16<S>,
    of: &[f32; N],
) -> (f32x16<S>, [f32x16<S>; M]) {
    let simd = t.token();
    let mut passed = [splat(simd, of[N - 1]); M];
    for i in (0..M - 1).rev() {
        passed[i] = passed[i + 1].mul_add(t, splat(simd, of[i + 1]));
    }
    (passed[0].mul_add(t, splat(simd, of[0])), passed)
}
