//! The kernel over a plane in single precision.

use fearless_simd::{f32x16, prelude::*};

/// Lengths of the fast sum are in units of the kernel's reach, which is this many widths. Of the
/// kernel's integral over a plane 1.6e-3 is left there, which the polynomial takes to zero.
pub(super) const REACH: f64 = 3.75;

/// Terms of the polynomial.
const TERMS: usize = 8;

/// `κ` of the kernel's integral over a plane ([`crate::contact`]) as a polynomial of the squared distance, both
/// in units of the reach: value and slope of `K` vanish there, its slope is off by 6e-4 at most and
/// its value by 1.1e-3 of the greatest. Least squares of both, reweighted to the least maximum.
pub(super) const ENTIRE: [f32; TERMS] = [
    0.053_250_687,
    1.117_901_8,
    -2.111_371,
    3.702_628_8,
    -4.535_737,
    3.549_470_3,
    -1.575_554_6,
    0.299_411_26,
];

/// `κ` about a squared height: `κ(t + v) = Σ d_j v^j`.
pub(super) struct Taylor<S: Simd> {
    pub(super) d: [f32x16<S>; TERMS],
}

impl<S: Simd> Taylor<S> {
    /// About `t`, at most one.
    #[inline(always)]
    pub(super) fn at(t: f32x16<S>) -> Self {
        let simd = t.token();
        let mut d = [f32x16::splat(simd, 0.0); TERMS];
        for j in 0..TERMS {
            d[j] = f32x16::splat(simd, ENTIRE[j]);
        }
        // Horner's scheme, again and again on what is left.
        for j in 0..TERMS - 1 {
            for i in (j..TERMS - 1).rev() {
                d[i] = d[i + 1].mul_add(t, d[i]);
            }
        }
        Self { d }
    }

    /// `∫ (κ(t + v) - κ(t)) / v dl`, its slope with `t`, and `∫ κ'(t + v) dl`, where
    /// `v = across² + l²`, from `a` to `b`.
    #[inline(always)]
    pub(super) fn along(
        &self,
        square: f32x16<S>,
        [a, b]: [f32x16<S>; 2],
        [va, vb]: [f32x16<S>; 2],
    ) -> [f32x16<S>; 3] {
        // moment_k = ∫ v^k dl = ([l v^k] + 2 k across² moment_(k - 1)) / (2 k + 1)
        let mut moment = b - a;
        let (mut ta, mut tb) = (a, b);
        let mut sums = [
            self.d[1] * moment,
            self.d[2] * (moment + moment),
            self.d[1] * moment,
        ];
        for k in 1..TERMS - 1 {
            ta *= va;
            tb *= vb;
            let odd = 1.0 / (2 * k + 1) as f32;
            let before = square * (moment * (2.0 * k as f32 * odd));
            moment = (tb - ta).mul_add(odd, before);
            let times = moment * (k + 1) as f32;
            sums[0] = self.d[k + 1].mul_add(moment, sums[0]);
            if k + 2 < TERMS {
                sums[1] = self.d[k + 2].mul_add(times + moment, sums[1]);
            }
            sums[2] = self.d[k + 1].mul_add(times, sums[2]);
        }
        sums
    }
}
