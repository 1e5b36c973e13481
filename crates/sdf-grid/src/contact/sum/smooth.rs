//! The kernel over a plane in single precision.

use fearless_simd::{f32x16, prelude::*};

use super::vectors::splat;

/// Lengths of the fast sum are in units of the kernel's reach, which is this many widths. Of the
/// kernel's integral over a plane 1.6e-3 is left there, which the polynomial takes to zero.
pub(super) const REACH: f64 = 3.75;

/// Terms of the polynomial.
const TERMS: usize = 8;

/// `κ` of the kernel's integral over a plane ([`crate::contact`]) as a polynomial of the squared distance, both
/// in units of the reach: value and slope of `K` vanish there, its slope is off by 6e-4 at most and
/// its value by 1.1e-3 of the greatest. Least squares of both, reweighted to the least maximum.
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

/// The second derivative with the height of the integral over a plane, without its spike on it, as a
/// polynomial of the squared height: off by 0.6 % of its greatest at most, one in all as the spike
/// takes, and smoothly zero at the reach. Least squares under these conditions, reweighted to the
/// least maximum.
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
    pub(super) fn at(t: f32x16<S>) -> Self {
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
    pub(super) fn along(
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
    pub(super) fn along_chord(&self, near: f32x16<S>, side: f32x16<S>) -> [f32x16<S>; 3] {
        let length = side + side;
        self.sums(
            near,
            length,
            #[inline(always)]
            || length,
        )
    }

    /// The sums over moments, `moment_k = ∫ r^k dl = ([l r^k] + 2 k near moment_(k - 1)) / (2 k + 1)`,
    /// where `ends` gives what is in brackets for k from 1 on.
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
