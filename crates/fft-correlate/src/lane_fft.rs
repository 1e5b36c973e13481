//! One-dimensional Fourier transforms of many lines at once: a vector register holds the same
//! element of as many lines as it has lanes, so that no transform ever shuffles a register.
//!
//! An element of a bundle of lines is `[re; L][im; L]`. Transforms are mixed-radix Stockham passes
//! (2, 3, 4, 5, 8) between two tiles that stay in the first-level cache; the first pass reads its
//! input through a closure and the last one writes its output through another, so that strides,
//! zero inputs, unwanted outputs and twiddles applied before or after cost no pass of their own.
//!
//! Only the positive exponent is needed, `y[k] = sum_x x[x] e^{+2 pi i k x / n}`, without a factor:
//! moving fields enter with it, because correlation conjugates them, and results return with it.

use std::f64::consts::TAU;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

use crate::lanes::{Strided, Tile};
use crate::radix::{Complex, inlined, pass};
use crate::real::Real;

/// The passes of a transform of one length.
#[derive(Debug, Clone)]
pub(crate) struct LaneFft<T> {
    len: usize,
    passes: Vec<Pass<T>>,
}

#[derive(Debug, Clone)]
struct Pass<T> {
    radix: usize,
    /// For every block of the pass, the factors of outputs 1 to `radix - 1`.
    twiddles: Vec<[T; 2]>,
}

/// The radices of a transform of `len` points in the order of its passes, or `None` if a prime
/// factor exceeds 5. Fours and eights come first and last, where passes read and write through
/// closures; the largest last, where there are no twiddles to apply.
pub(crate) fn radices(len: usize) -> Option<Vec<usize>> {
    let mut rest = len;
    let mut count = |prime: usize| {
        let mut n = 0;
        while rest > 0 && rest.is_multiple_of(prime) {
            rest /= prime;
            n += 1;
        }
        n
    };
    let (twos, threes, fives) = (count(2), count(3), count(5));
    if rest != 1 {
        return None;
    }
    let (eights, fours, two) = match (twos % 3, twos / 3) {
        (0, n) => (n, 0, 0),
        (1, 0) => (0, 0, 1),
        (1, n) => (n - 1, 2, 0),
        (_, n) => (n, 1, 0),
    };
    let mut powers = vec![4; fours];
    powers.extend(std::iter::repeat_n(8, eights));
    let mut radices = Vec::new();
    let last = powers.pop();
    if !powers.is_empty() {
        radices.push(powers.remove(0));
    }
    radices.extend(std::iter::repeat_n(5, fives));
    radices.extend(std::iter::repeat_n(3, threes));
    radices.extend(std::iter::repeat_n(2, two));
    radices.extend(powers);
    radices.extend(last);
    Some(radices)
}

impl<T: Real> LaneFft<T> {
    /// A transform of `len` points; `None` if `len` is zero or has a prime factor above 5.
    pub(crate) fn new(len: usize) -> Option<Self> {
        let mut rest = len;
        let passes = radices(len)?
            .into_iter()
            .map(|radix| {
                let blocks = rest / radix;
                let turn = TAU / rest as f64;
                let twiddle = |p: usize, j: usize| {
                    // Reduced first: the product may be far larger than the period.
                    let (sin, cos) = (turn * (p * j % rest) as f64).sin_cos();
                    [T::nearest(cos), T::nearest(sin)]
                };
                let twiddles = (0..blocks)
                    .flat_map(|p| (1..radix).map(move |j| (p, j)))
                    .map(|(p, j)| twiddle(p, j))
                    .collect();
                rest = blocks;
                Pass { radix, twiddles }
            })
            .collect();
        (len > 0).then_some(Self { len, passes })
    }

    /// The tiles for a transform into `to`, which a last pass must not read from.
    pub(crate) fn tiles_to(&self, to: Tile<T>, other: Tile<T>) -> [Tile<T>; 2] {
        if self.passes.len().is_multiple_of(2) {
            [to, other]
        } else {
            [other, to]
        }
    }

    /// Transforms the bundle that `load(index)` reads; `store(index, value)` receives the result.
    /// Both tiles are overwritten; the input may be the first. All reads of the input happen
    /// before any write of the result.
    ///
    /// # Safety
    /// Both tiles must hold `len` elements of `2 * LANES` numbers.
    #[inline(always)]
    pub(crate) unsafe fn process<S: Simd>(
        &self,
        simd: S,
        tiles: [Tile<T>; 2],
        load: impl Fn(usize) -> Complex<T::Native<S>>,
        mut store: impl FnMut(usize, Complex<T::Native<S>>),
    ) {
        let [mut from, mut to] = tiles;
        let fused = |index: usize| matches!(self.passes[index].radix, 4 | 8);
        let count = self.passes.len();
        let (mut done, mut rest, mut stride) = (0, self.len, 1);
        // SAFETY (of the tile accesses below): passes read and write elements below `len`.
        if count > 1 && fused(0) {
            let Pass { radix, twiddles } = &self.passes[0];
            let write = inlined(
                #[inline(always)]
                // SAFETY: as said above.
                |i, v| unsafe { to.put(simd, i, v) },
            );
            if *radix == 4 {
                pass::<S, T, 4>(simd, rest, stride, twiddles, load, write);
            } else {
                pass::<S, T, 8>(simd, rest, stride, twiddles, load, write);
            }
            (done, rest, stride) = (1, rest / radix, *radix);
        } else {
            for i in 0..self.len {
                // SAFETY: as said above.
                unsafe { from.put(simd, i, load(i)) };
            }
            std::mem::swap(&mut from, &mut to);
        }
        let last = count.saturating_sub(1);
        let through = count > 1 && fused(last);
        let between = if through { last } else { count };
        for Pass { radix, twiddles } in &self.passes[done..between] {
            std::mem::swap(&mut from, &mut to);
            // SAFETY: as said above.
            unsafe { middle_pass(simd, *radix, rest, stride, twiddles, [from, to]) };
            (rest, stride) = (rest / radix, stride * radix);
        }
        let read = inlined(
            #[inline(always)]
            // SAFETY: as said above.
            |i| unsafe { to.get(simd, i) },
        );
        if !through {
            for i in 0..self.len {
                store(i, read(i));
            }
        } else if self.passes[last].radix == 4 {
            pass::<S, T, 4>(simd, rest, stride, &[], read, store);
        } else {
            pass::<S, T, 8>(simd, rest, stride, &[], read, store);
        }
    }
}

/// [`LaneFft::process`] from one bundle to another. Not inlined: it is the same for most
/// transforms.
///
/// # Safety
/// As [`LaneFft::process`]; no one else may use the bundles.
#[simd]
pub(crate) unsafe fn transform<S: Simd, T: Real>(
    simd: S,
    fft: &LaneFft<T>,
    tiles: [Tile<T>; 2],
    from: &Strided<T>,
    to: &Strided<T>,
) {
    // SAFETY: as demanded.
    unsafe {
        fft.process(
            simd,
            tiles,
            #[inline(always)]
            |i| from.get(simd, i),
            #[inline(always)]
            |i, v| to.put(simd, i, v),
        );
    }
}

/// One pass of any radix from tile to tile. Not inlined: it is the same for all transforms.
///
/// # Safety
/// As [`LaneFft::process`].
#[simd]
unsafe fn middle_pass<S: Simd, T: Real>(
    simd: S,
    radix: usize,
    rest: usize,
    stride: usize,
    twiddles: &[[T; 2]],
    [from, to]: [Tile<T>; 2],
) {
    let load = inlined(
        #[inline(always)]
        // SAFETY: as said above.
        |i| unsafe { from.get(simd, i) },
    );
    let store = inlined(
        #[inline(always)]
        // SAFETY: as said above.
        |i, v| unsafe { to.put(simd, i, v) },
    );
    match radix {
        2 => pass::<S, T, 2>(simd, rest, stride, twiddles, load, store),
        3 => pass::<S, T, 3>(simd, rest, stride, twiddles, load, store),
        4 => pass::<S, T, 4>(simd, rest, stride, twiddles, load, store),
        5 => pass::<S, T, 5>(simd, rest, stride, twiddles, load, store),
        _ => pass::<S, T, 8>(simd, rest, stride, twiddles, load, store),
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::Level;
    use num_complex::Complex as Number;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};
    use rustfft::FftPlanner;

    use super::*;
    use crate::lanes::{Buffer, dispatch_lanes};

    /// Transforms one bundle of lines, given and returned as `[element][re, im][lane]`.
    #[simd]
    fn bundle<S: Simd, T: Real>(simd: S, len: usize, lines: &mut Buffer<T>) -> usize {
        let fft = LaneFft::<T>::new(len).unwrap();
        let lanes = T::Native::<S>::LEN;
        let mut tiles: [Buffer<T>; 2] =
            std::array::from_fn(|_| Buffer::zeroed(2 * lanes * fft.len));
        let [a, b] = &mut tiles;
        let (a, b, at) = (a.tile(), b.tile(), lines.tile());
        let at = Strided::even(at, 0..len, 2 * lanes);
        // SAFETY: the tiles hold `len` elements, and so does the buffer.
        unsafe { transform(simd, &fft, [a, b], &at, &at) };
        lanes
    }

    /// Relative L2 distance of all lanes from rustfft in double precision.
    fn error<T: Real>(level: Level, len: usize, rng: &mut SmallRng) -> f64 {
        let mut lines = Buffer::<T>::zeroed(2 * 16 * len);
        let random = || T::nearest(rng.random_range(-1.0..1.0));
        lines.as_mut_slice().fill_with(random);
        let before: Vec<f64> = lines.as_slice().iter().map(|v| (*v).into()).collect();
        let lanes = dispatch_lanes!(level, simd => bundle(simd, len, &mut lines));
        let fft = FftPlanner::new().plan_fft_inverse(len);
        let (mut wrong, mut size) = (0.0, 0.0);
        for lane in 0..lanes {
            let at = |i: usize, part: usize| (2 * i + part) * lanes + lane;
            let mut line: Vec<_> = (0..len)
                .map(|i| Number::new(before[at(i, 0)], before[at(i, 1)]))
                .collect();
            fft.process(&mut line);
            for (i, exact) in line.iter().enumerate() {
                let found = [0, 1].map(|part| lines.as_slice()[at(i, part)].into());
                wrong += (Number::new(found[0], found[1]) - exact).norm_sqr();
                size += exact.norm_sqr();
            }
        }
        (wrong / size).sqrt()
    }

    fn levels() -> [Level; 2] {
        [Level::new(), Level::baseline()]
    }

    /// Every length with the factors 2, 3 and 5 up to 512, with this machine's vectors and with
    /// those that every machine of its kind has, against rustfft. Rounding grows like the root of
    /// the number of passes: a few times 6e-8 in f32 and 1.1e-16 in f64.
    #[test]
    fn equals_rustfft_for_all_lengths() {
        let mut rng = SmallRng::seed_from_u64(4);
        let mut seen = 0;
        for len in (1..=512).filter(|n| radices(*n).is_some()) {
            seen += 1;
            for level in levels() {
                let single = error::<f32>(level, len, &mut rng);
                let double = error::<f64>(level, len, &mut rng);
                assert!(single < 4e-7, "{len}: {single}");
                assert!(double < 8e-16, "{len}: {double}");
            }
        }
        assert_eq!(seen, 68, "lengths of the form 2^a 3^b 5^c up to 512");
    }

    #[test]
    fn radices_multiply_to_the_length_or_there_are_none() {
        for len in 1..2000 {
            match radices(len) {
                Some(r) => assert_eq!(r.iter().product::<usize>(), len),
                None => assert!((7..=len).any(|p| len % p == 0 && p % 2 * (p % 3) * (p % 5) > 0)),
            }
        }
        assert!(radices(0).is_none());
    }
}
