//! Butterflies of the lane-batched transforms, and the Stockham pass made of them.

use fearless_simd::prelude::*;

use super::tile::{Complex, Tile, element};
use crate::correlate::real::Real;
use crate::vectors::inlined;
use sdf_grid::prefetch::fetch;

#[inline(always)]
fn add<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>) -> Complex<V> {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline(always)]
fn sub<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>) -> Complex<V> {
    [a[0] - b[0], a[1] - b[1]]
}

/// `a + i b`.
#[inline(always)]
fn add_i<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>) -> Complex<V> {
    [a[0] - b[1], a[1] + b[0]]
}

/// `a - i b`.
#[inline(always)]
fn sub_i<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>) -> Complex<V> {
    [a[0] + b[1], a[1] - b[0]]
}

/// `a + b s` for a real factor.
#[inline(always)]
fn scaled<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>, s: V) -> Complex<V> {
    [b[0].mul_add(s, a[0]), b[1].mul_add(s, a[1])]
}

/// `a b`.
#[inline(always)]
pub(crate) fn mul<S: Simd, V: SimdFloat<S>>(a: Complex<V>, b: Complex<V>) -> Complex<V> {
    [
        a[0].mul_sub(b[0], a[1] * b[1]),
        a[0].mul_add(b[1], a[1] * b[0]),
    ]
}

/// A factor for all lanes.
#[inline(always)]
fn splat<S: Simd, T: Real>(simd: S, [re, im]: [T; 2]) -> Complex<T::Native<S>> {
    [
        T::Native::<S>::splat(simd, re),
        T::Native::<S>::splat(simd, im),
    ]
}

#[inline(always)]
fn four<S: Simd, V: SimdFloat<S>>(a: [Complex<V>; 4]) -> [Complex<V>; 4] {
    let (s02, d02) = (add(a[0], a[2]), sub(a[0], a[2]));
    let (s13, d13) = (add(a[1], a[3]), sub(a[1], a[3]));
    [
        add(s02, s13),
        add_i(d02, d13),
        sub(s02, s13),
        sub_i(d02, d13),
    ]
}

/// The transform of `R` elements with the positive exponent.
#[inline(always)]
fn butterfly<S: Simd, T: Real, const R: usize>(
    simd: S,
    a: [Complex<T::Native<S>>; R],
) -> [Complex<T::Native<S>>; R] {
    let real = inlined(
        #[inline(always)]
        |v: f64| T::Native::<S>::splat(simd, T::nearest(v)),
    );
    let mut y = a;
    match R {
        1 => {}
        2 => (y[0], y[1]) = (add(a[0], a[1]), sub(a[0], a[1])),
        3 => {
            let (sum, difference) = (add(a[1], a[2]), sub(a[1], a[2]));
            let middle = scaled(a[0], sum, real(-0.5));
            let sine = real(3f64.sqrt() / 2.0);
            let d = [difference[0] * sine, difference[1] * sine];
            y[0] = add(a[0], sum);
            (y[1], y[2]) = (add_i(middle, d), sub_i(middle, d));
        }
        4 => y[..4].copy_from_slice(&four([a[0], a[1], a[2], a[3]])),
        5 => {
            let root = 5f64.sqrt();
            let (c1, c2) = (real((root - 1.0) / 4.0), real((-root - 1.0) / 4.0));
            let s1 = real((10.0 + 2.0 * root).sqrt() / 4.0);
            let s2 = real((10.0 - 2.0 * root).sqrt() / 4.0);
            let (p, m) = (add(a[1], a[4]), sub(a[1], a[4]));
            let (q, n) = (add(a[2], a[3]), sub(a[2], a[3]));
            let t1 = scaled(scaled(a[0], p, c1), q, c2);
            let t2 = scaled(scaled(a[0], p, c2), q, c1);
            let u1 = scaled([m[0] * s1, m[1] * s1], n, s2);
            let u2 = scaled([m[0] * s2, m[1] * s2], n, -s1);
            y[0] = add(a[0], add(p, q));
            (y[1], y[4]) = (add_i(t1, u1), sub_i(t1, u1));
            (y[2], y[3]) = (add_i(t2, u2), sub_i(t2, u2));
        }
        8 => {
            let e = four([a[0], a[2], a[4], a[6]]);
            let f = four([a[1], a[3], a[5], a[7]]);
            let half = real(0.5f64.sqrt());
            // e^{i pi / 4} f1 and e^{3 i pi / 4} f3, before the factor.
            let g1 = [f[1][0] - f[1][1], f[1][0] + f[1][1]];
            let g3 = [f[3][0] + f[3][1], f[3][0] - f[3][1]];
            (y[0], y[4]) = (add(e[0], f[0]), sub(e[0], f[0]));
            (y[1], y[5]) = (scaled(e[1], g1, half), scaled(e[1], g1, -half));
            (y[2], y[6]) = (add_i(e[2], f[2]), sub_i(e[2], f[2]));
            y[3] = [g3[0].mul_add(-half, e[3][0]), g3[1].mul_add(half, e[3][1])];
            y[7] = [g3[0].mul_add(half, e[3][0]), g3[1].mul_add(-half, e[3][1])];
        }
        _ => unreachable!("radices are 1 to 5 and 8"),
    }
    y
}

/// One Stockham pass of radix `R` over `stride` interleaved transforms of which `rest` points each
/// are left: element `q + stride (p + j rest / R)` in, `q + stride (R p + j)` out.
#[inline(always)]
pub(crate) fn pass<S: Simd, T: Real, const R: usize>(
    simd: S,
    rest: usize,
    stride: usize,
    twiddles: &[[T; 2]],
    load: impl Fn(usize) -> Complex<T::Native<S>>,
    mut store: impl FnMut(usize, Complex<T::Native<S>>),
) {
    let blocks = rest / R;
    let span = stride * blocks;
    let zero = T::Native::<S>::splat(simd, T::zero());
    // Plain loops over arrays: closures of the standard library might not be inlined, and code
    // outside has no vector instructions.
    let mut x = [[zero; 2]; R];
    if blocks == 1 {
        for q in 0..stride {
            for (j, x) in x.iter_mut().enumerate() {
                *x = load(q + j * span);
            }
            let y = butterfly::<S, T, R>(simd, x);
            for (j, y) in y.iter().enumerate() {
                store(q + j * stride, *y);
            }
        }
        return;
    }
    for (p, factors) in twiddles.chunks_exact(R - 1).enumerate() {
        let mut w = [[zero; 2]; R];
        for (w, factor) in w[1..].iter_mut().zip(factors) {
            *w = splat::<S, T>(simd, *factor);
        }
        for q in 0..stride {
            let at = q + stride * p;
            for (j, x) in x.iter_mut().enumerate() {
                *x = load(at + j * span);
            }
            let y = butterfly::<S, T, R>(simd, x);
            let to = q + stride * R * p;
            store(to, y[0]);
            for j in 1..R {
                store(to + j * stride, mul(y[j], w[j]));
            }
        }
    }
}

/// Real parts of `e^{i pi j / 8}`; the imaginary part is that of `j` four places on, negated.
const ROOTS: [f64; 12] = [
    1.0,
    0.923_879_532_511_286_8,
    std::f64::consts::FRAC_1_SQRT_2,
    0.382_683_432_365_089_8,
    0.0,
    -0.382_683_432_365_089_8,
    -std::f64::consts::FRAC_1_SQRT_2,
    -0.923_879_532_511_286_8,
    -1.0,
    -0.923_879_532_511_286_8,
    -std::f64::consts::FRAC_1_SQRT_2,
    -0.382_683_432_365_089_8,
];

/// `a e^{i pi j / H}` for `H` of 4 or 8.
#[inline(always)]
fn turned<S: Simd, T: Real, const H: usize>(
    simd: S,
    a: Complex<T::Native<S>>,
    j: usize,
) -> Complex<T::Native<S>> {
    let eighth = j * 8 / H;
    match eighth {
        0 => a,
        4 => [-a[1], a[0]],
        _ => {
            let cos = T::Native::<S>::splat(simd, T::nearest(ROOTS[eighth]));
            let sin = T::Native::<S>::splat(simd, T::nearest(-ROOTS[eighth + 4]));
            mul(a, [cos, sin])
        }
    }
}

/// The first pass, of radix `2 H`, of a transform of `len` points whose second half is zero and is
/// never read. Even outputs are a butterfly of `H` inputs, odd ones another of the same inputs
/// turned.
#[inline(always)]
pub(crate) fn pass_from_half<S: Simd, T: Real, const H: usize>(
    simd: S,
    len: usize,
    twiddles: &[[T; 2]],
    load: impl Fn(usize) -> Complex<T::Native<S>>,
    mut store: impl FnMut(usize, Complex<T::Native<S>>),
) {
    let blocks = len / (2 * H);
    let zero = T::Native::<S>::splat(simd, T::zero());
    let mut x = [[zero; 2]; H];
    for (p, factors) in twiddles.chunks_exact(2 * H - 1).enumerate().take(blocks) {
        let factor = inlined(
            #[inline(always)]
            |j: usize| splat::<S, T>(simd, factors[j - 1]),
        );
        let to = 2 * H * p;
        for (j, x) in x.iter_mut().enumerate() {
            *x = load(p + j * blocks);
        }
        let y = butterfly::<S, T, H>(simd, x);
        store(to, y[0]);
        for (j, y) in y.iter().enumerate().skip(1) {
            store(to + 2 * j, mul(*y, factor(2 * j)));
        }
        // Read again: there are not enough registers to keep them.
        for (j, x) in x.iter_mut().enumerate() {
            *x = turned::<S, T, H>(simd, load(p + j * blocks), j);
        }
        let y = butterfly::<S, T, H>(simd, x);
        for (j, y) in y.iter().enumerate() {
            store(to + 2 * j + 1, mul(*y, factor(2 * j + 1)));
        }
    }
}

/// The last pass, of radix `2 H`, of a transform of which only half of the outputs are wanted and
/// stored: those from number `first` on, which may go on at 0 beyond the end.
#[inline(always)]
pub(crate) fn pass_to_half<S: Simd, T: Real, const H: usize>(
    simd: S,
    stride: usize,
    first: usize,
    load: impl Fn(usize) -> Complex<T::Native<S>>,
    mut store: impl FnMut(usize, Complex<T::Native<S>>),
) {
    let zero = T::Native::<S>::splat(simd, T::zero());
    let half = H * stride;
    let (turn, far) = (first % half, first >= half);
    let mut x = [[zero; 2]; H];
    for q in 0..stride {
        for (j, x) in x.iter_mut().enumerate() {
            *x = load(q + (2 * j + 1) * stride);
        }
        let odd = butterfly::<S, T, H>(simd, x);
        for (j, x) in x.iter_mut().enumerate() {
            *x = load(q + 2 * j * stride);
        }
        let even = butterfly::<S, T, H>(simd, x);
        for j in 0..H {
            let turned = turned::<S, T, H>(simd, odd[j], j);
            let k = q + j * stride;
            if (k < turn) == far {
                store(k, add(even[j], turned));
            } else {
                store(k + half, sub(even[j], turned));
            }
        }
    }
}

/// Blocks of the fixed spectra that are asked for ahead of their use: they come from far away, and
/// are read in bursts.
const AHEAD: usize = 2;

/// The last pass, of radix `R`, of the transforms of all `lines`, the sum of their products with
/// the fixed spectra, and the first pass of its transform back, `2 lanes` numbers per element:
/// outputs of the one are inputs of the other, so that no spectrum is ever stored.
///
/// `fixed` holds, for each line, the elements in the order in which they are met: `R` for each of
/// the `len / R` blocks, blocks `fixed_stride` numbers apart. Lines and `out` hold `len` elements.
#[inline(always)]
pub(crate) fn turning_pass<S: Simd, T: Real, const R: usize>(
    simd: S,
    blocks: usize,
    twiddles: &[[T; 2]],
    lines: &[(Tile<'_, T>, &[T])],
    fixed_stride: usize,
    out: Tile<'_, T>,
) {
    let zero = T::Native::<S>::splat(simd, T::zero());
    for p in 0..blocks {
        // The sum of the products waits in memory: in registers there is no room for it.
        let sum = out.from(R * p * 2 * T::Native::<S>::LEN);
        for (i, (line, fixed)) in lines.iter().enumerate() {
            for number in (0..2 * R * T::Native::<S>::LEN).step_by(64 / size_of::<T>()) {
                let ahead = (p + AHEAD) * fixed_stride + number;
                fetch(fixed.as_ptr().wrapping_add(ahead));
            }
            let fixed = &fixed[p * fixed_stride..];
            if i == 0 {
                products::<S, T, R, true>(simd, *line, p, blocks, fixed, sum);
            } else {
                products::<S, T, R, false>(simd, *line, p, blocks, fixed, sum);
            }
        }
        let mut x = [[zero; 2]; R];
        for (j, x) in x.iter_mut().enumerate() {
            *x = sum.get(simd, j);
        }
        let y = butterfly::<S, T, R>(simd, x);
        let factors = &twiddles[p * (R - 1)..][..R - 1];
        sum.put(simd, 0, y[0]);
        for j in 1..R {
            let w = splat::<S, T>(simd, factors[j - 1]);
            sum.put(simd, j, mul(y[j], w));
        }
    }
}

/// The last pass of one line for block `p`, times the fixed spectrum: the first products or added
/// to those there are.
#[inline(always)]
fn products<S: Simd, T: Real, const R: usize, const FIRST: bool>(
    simd: S,
    line: Tile<'_, T>,
    p: usize,
    blocks: usize,
    fixed: &[T],
    sum: Tile<'_, T>,
) {
    let lanes = T::Native::<S>::LEN;
    let mut x = [[T::Native::<S>::splat(simd, T::zero()); 2]; R];
    for (j, x) in x.iter_mut().enumerate() {
        *x = line.get(simd, p + j * blocks);
    }
    let y = butterfly::<S, T, R>(simd, x);
    let fixed = &fixed[..2 * R * lanes];
    for (j, y) in y.iter().enumerate() {
        let a = element(simd, &fixed[2 * j * lanes..]);
        let product = if FIRST {
            mul(a, *y)
        } else {
            add_mul(sum.get(simd, j), a, *y)
        };
        sum.put(simd, j, product);
    }
}

/// `sum + a b`.
#[inline(always)]
pub(crate) fn add_mul<S: Simd, V: SimdFloat<S>>(
    sum: Complex<V>,
    a: Complex<V>,
    b: Complex<V>,
) -> Complex<V> {
    let re = a[0].mul_add(b[0], sum[0]);
    let im = a[0].mul_add(b[1], sum[1]);
    [a[1].mul_add(-b[1], re), a[1].mul_add(b[0], im)]
}
