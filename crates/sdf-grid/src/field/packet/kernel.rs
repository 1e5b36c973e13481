//! The kernel for packets: polynomials for the cumulative kernel, closed forms for the far field.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, i32x16};
use num_complex::Complex64;

use super::accuracy::Accuracy;
use crate::field::kernel::CumulativeKernel;
use crate::field::quadrature::GaussLegendre;

/// Gauss points per edge at most. Only wide kernels ask for more, at 1e-5, and gain nothing by 40.
pub(crate) const MAX_POINTS: usize = 20;

/// The kernel truncated at the settings' reach and rescaled so that a half space stays exact.
pub(crate) struct PacketKernel {
    pub(crate) sigma: f32,
    pub(crate) reach: f32,
    /// Rescaling of the truncated kernel, real and imaginary.
    gain: [f32; 2],
    above: Rise,
    below: Rise,
    /// `K(reach) - K(0)`.
    pub(crate) beyond: [f32; 2],
    /// Nodes and weights by number of points.
    pub(crate) rules: Vec<Vec<[f32; 2]>>,
}

impl PacketKernel {
    pub(crate) fn new(table: &CumulativeKernel, accuracy: &Accuracy, tolerance: f64) -> Self {
        let kernel = table.kernel();
        let sigma = kernel.sigma();
        // Truncated at the reach and scaled so that the total stays.
        let zero = table.evaluate(0.0);
        let (whole, cut) = (table.total() - zero, table.evaluate(accuracy.reach) - zero);
        let gain = Complex64::new(whole.re / cut.re, whole.im / cut.im);
        let scaled = |x: f64| {
            let k = table.evaluate(x) - zero;
            Complex64::new(k.re * gain.re, k.im * gain.im)
        };
        let slope = kernel.cumulative_slope(0.0);
        let slope = Complex64::new(slope.re * gain.re, slope.im * gain.im);
        let above = |y: f64| scaled(((1.0 + y).sqrt() - 1.0) / sigma);
        // Errors of the kernel pass into the density one to one; single precision is the floor.
        let error = (0.1 * tolerance).max(2e-7) * whole.norm();
        // Intervals of the two fits.
        let square = |x: f64| (1.0 + sigma * x).powi(2) - 1.0;
        let deepest = -(1.0 / sigma).min(accuracy.reach + 0.5);
        let rule = |n| {
            let rule = GaussLegendre::new(n);
            let pairs = rule.nodes.iter().zip(&rule.weights);
            pairs.map(|(x, w)| [*x as f32, *w as f32]).collect()
        };
        Self {
            sigma: sigma as f32,
            reach: accuracy.reach as f32,
            gain: [gain.re as f32, gain.im as f32],
            above: Rise::fit(
                0.0,
                square(accuracy.reach),
                slope / (2.0 * sigma),
                error,
                above,
            ),
            below: Rise::fit(deepest, 0.0, slope, error, scaled),
            beyond: [whole.re as f32, whole.im as f32],
            rules: (0..=MAX_POINTS).map(rule).collect(),
        }
    }

    /// `K - K(x = 0)` at `y = u^2 - 1 >= 0`.
    #[inline(always)]
    pub(crate) fn rise<S: Simd, const N: usize>(&self, y: [f32x16<S>; N]) -> [[f32x16<S>; 2]; N] {
        self.above.evaluate(y)
    }

    /// The same for any `u >= 0`. Below 1 by `x`: at zero `K` is no smooth function of `u^2`.
    #[inline(always)]
    pub(crate) fn rise_from_below<S: Simd>(&self, u: f32x16<S>) -> [f32x16<S>; 2] {
        let y = u * u - 1.0;
        let [above] = self.above.evaluate([y]);
        let [below] = self.below.evaluate([(u - 1.0) * (1.0 / self.sigma)]);
        let positive = y.simd_ge(0.0);
        [
            positive.select(above[0], below[0]),
            positive.select(above[1], below[1]),
        ]
    }

    /// `G flat + (G' / u) first + (G'' - G' / u) bow`, real and imaginary, with `G` of
    /// [`crate::DensityKernel::radial`], given `x`, `u`, `1 / u` and `w = 1 / (1 + u^2)`.
    ///
    /// `G` is `e^{-x^2/2} / (u (1 - i u)^2)` but for constants. So `G' = G q` and `G'' = G (q^2 +
    /// q')` with `q = -(x / sigma + 1 / u) + 2 i / (1 - i u)`: one exponential, one complex
    /// product.
    #[inline(always)]
    pub(crate) fn expansion<S: Simd>(
        &self,
        [x, u, iu, w]: [f32x16<S>; 4],
        [flat, first, bow]: [f32x16<S>; 3],
    ) -> [f32x16<S>; 2] {
        let is = 1.0 / self.sigma;
        let e = exp(x * x * -0.5) * (is / (2.0 * std::f32::consts::PI));
        // 1 / (1 - i u) = w + i u w.
        let (uw, twice) = (u * w, w + w);
        let we = w * e;
        let g = [we * (twice - 1.0) * iu, we * twice];
        // -q, then q^2 + q'.
        let q = [uw.mul_add(2.0, x.mul_add(is, iu)), -twice];
        let q2 = [
            q[0].mul_add(q[0], iu * iu) + twice * w.mul_add(-4.0, 1.0) - is * is,
            w * (q[0] + uw) * -4.0,
        ];
        let slope = iu * (bow - first);
        let re = q[0].mul_add(slope, q2[0].mul_add(bow, flat));
        let im = q[1].mul_add(slope, q2[1] * bow);
        [
            (g[0] * re - g[1] * im) * self.gain[0],
            (g[0] * im + g[1] * re) * self.gain[1],
        ]
    }
}

/// Terms of a polynomial at most.
const MOST_TERMS: usize = 32;

/// Places at which the error of a polynomial is looked at.
const SAMPLES: usize = 200;

/// `x Q(x)` on an interval that begins or ends at zero, real and imaginary: exact at zero, so that
/// small differences of the cumulative kernel near the foot of a perpendicular keep their digits.
struct Rise {
    start: f32,
    end: f32,
    middle: f32,
    inverse_half: f32,
    /// Powers of `(x - middle) / half`, highest first.
    coefficients: Vec<[f32; 2]>,
}

impl Rise {
    /// Fits `f`, which is zero with slope `slope` at zero, on `[start, end]` to `error`, at the
    /// ends exactly.
    fn fit(
        start: f64,
        end: f64,
        slope: Complex64,
        error: f64,
        f: impl Fn(f64) -> Complex64,
    ) -> Self {
        let (middle, half) = (0.5 * (start + end), 0.5 * (end - start));
        // `f(x) / x` is smooth at zero.
        let quotient = |t: f64| {
            let x = middle + half * t;
            if x.abs() < 1e-6 { slope } else { f(x) / x }
        };
        let place = |i: usize| (std::f64::consts::PI * (i as f64 + 0.5) / SAMPLES as f64).cos();
        let samples: Vec<_> = (0..SAMPLES)
            .map(|i| (place(i), quotient(place(i))))
            .collect();
        let good = |series: &Vec<Complex64>| {
            let off = |(t, q): &(f64, Complex64)| {
                (evaluate_series(series, *t) - q).norm() * (middle + half * t).abs()
            };
            samples.iter().all(|s| off(s) < error)
        };
        // The shortest Chebyshev series within the error.
        let mut fewer = (4..MOST_TERMS).map(|n| interpolant(n, quotient));
        let series = fewer.find(good);
        let powers = powers(&series.unwrap_or_else(|| interpolant(MOST_TERMS, quotient)));
        let single = |c: &Complex64| [c.re as f32, c.im as f32];
        Self {
            start: start as f32,
            end: end as f32,
            middle: middle as f32,
            inverse_half: (1.0 / half) as f32,
            coefficients: powers.iter().rev().map(single).collect(),
        }
    }

    /// At several places at once: the steps of one wait for each other, those of several do not.
    /// Loops, not closures: these would not be compiled for the instruction set.
    #[inline(always)]
    fn evaluate<S: Simd, const N: usize>(&self, mut x: [f32x16<S>; N]) -> [[f32x16<S>; 2]; N] {
        let simd = x[0].token();
        let zero = f32x16::splat(simd, 0.0);
        let (mut t, mut sum) = ([zero; N], [[zero; 2]; N]);
        for i in 0..N {
            x[i] = x[i].max(self.start).min(self.end);
            t[i] = (x[i] - self.middle) * self.inverse_half;
        }
        for c in &self.coefficients {
            let (re, im) = (f32x16::splat(simd, c[0]), f32x16::splat(simd, c[1]));
            for i in 0..N {
                sum[i] = [sum[i][0].mul_add(t[i], re), sum[i][1].mul_add(t[i], im)];
            }
        }
        for i in 0..N {
            sum[i] = [sum[i][0] * x[i], sum[i][1] * x[i]];
        }
        sum
    }
}

/// The Chebyshev series of the polynomial through `f` at `n` places of `[-1, 1]`, its ends among
/// them.
fn interpolant(n: usize, f: impl Fn(f64) -> Complex64) -> Vec<Complex64> {
    let last = n - 1;
    let angle = |i: usize| std::f64::consts::PI * i as f64 / last as f64;
    let end = |k: usize| if k == 0 || k == last { 0.5 } else { 1.0 };
    let values: Vec<Complex64> = (0..n).map(|i| f(angle(i).cos()) * end(i)).collect();
    let coefficient = |k: usize| {
        let terms = values.iter().enumerate();
        let terms = terms.map(|(i, v)| v * (k as f64 * angle(i)).cos());
        terms.sum::<Complex64>() * (2.0 * end(k) / last as f64)
    };
    (0..n).map(coefficient).collect()
}

/// A Chebyshev series at a place.
fn evaluate_series(series: &[Complex64], t: f64) -> Complex64 {
    let (mut a, mut b) = (Complex64::ZERO, Complex64::ZERO);
    for c in series[1..].iter().rev() {
        (a, b) = (c + a * (2.0 * t) - b, a);
    }
    series[0] + a * t - b
}

/// Coefficients of powers, lowest first, of a Chebyshev series.
fn powers(series: &[Complex64]) -> Vec<Complex64> {
    let n = series.len();
    let (mut current, mut next) = (vec![0.0; n], vec![0.0; n]);
    let mut sum = vec![Complex64::ZERO; n];
    (current[0], next[1.min(n - 1)]) = (1.0, 1.0);
    for c in series {
        for (s, p) in sum.iter_mut().zip(&current) {
            *s += c * *p;
        }
        // T(k + 2) = 2 t T(k + 1) - T(k).
        let mut after: Vec<f64> = current.iter().map(|p| -p).collect();
        for i in 1..n {
            after[i] += 2.0 * next[i - 1];
        }
        (current, next) = (next, after);
    }
    sum
}

/// The exponential of a non-positive number to about 2e-7; zero below -80.
#[inline(always)]
pub(super) fn exp<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    let simd = x.token();
    let y = x.max(-80.0) * std::f32::consts::LOG2_E;
    let n = y.round_ties_even();
    let f = y - n;
    // 2^f on -1/2 ..= 1/2, by least largest relative error.
    let mut p = f32x16::splat(simd, 1.327_647_2e-3);
    for c in [
        9.675_541e-3,
        5.550_713e-2,
        2.402_212e-1,
        6.931_469_4e-1,
        1.0,
    ] {
        p = p.mul_add(f, f32x16::splat(simd, c));
    }
    // 2^n by its exponent bits.
    let bits: i32x16<S> = ((n + 127.0) * 8_388_608.0).to_int();
    p * bits.bitcast::<f32x16<S>>()
}
