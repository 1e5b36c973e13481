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
use sdf_grid::prefetch::ask_for;

use crate::correlate::kernels::radix::{pass, pass_from_half, pass_to_half, turning_pass};
use crate::correlate::kernels::tile::{Complex, Line, Tile};
use crate::correlate::real::Real;
use crate::vectors::inlined;

/// The passes of a transform of one length.
#[derive(Debug, Clone)]
pub(crate) struct LaneFft<T> {
    len: usize,
    passes: Vec<Pass<T>>,
    /// Where the wanted outputs begin, if only half of them are.
    first_output: usize,
}

#[derive(Debug, Clone)]
struct Pass<T> {
    step: RadixStep,
    /// For every block of the pass, the factors of outputs 1 to `radix - 1`.
    twiddles: Vec<[T; 2]>,
}

impl<T: Real> LaneFft<T> {
    /// A transform of `len` points; `None` if `len` is zero or has a prime factor above 5.
    pub(crate) fn new(len: usize, ends: LineEnds) -> Option<Self> {
        Some(Self::from_steps(len, steps(len, ends)?))
    }

    /// Transforms there and back that meet at one radix, so that [`LaneFft::turn`] takes products
    /// between them.
    pub(crate) fn pair(len: usize, from_half: bool, to_half: bool) -> Option<[Self; 2]> {
        let [there, back] = turning_steps(len, from_half, to_half)?;
        Some([Self::from_steps(len, there), Self::from_steps(len, back)])
    }

    fn from_steps(len: usize, steps: Vec<RadixStep>) -> Self {
        let mut rest = len;
        let passes = steps.into_iter().map(|step| {
            let radix = step.radix;
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
            Pass { step, twiddles }
        });
        Self {
            passes: passes.collect(),
            len,
            first_output: 0,
        }
    }

    /// The same transform; if only half of its outputs are wanted, those from number `first` on,
    /// which go on at 0 beyond the end.
    pub(crate) fn with_first_output(self, first: usize) -> Self {
        Self {
            first_output: first % self.len,
            ..self
        }
    }

    /// How many elements of a line are read: the rest are zero.
    fn reads(&self) -> usize {
        match self.passes.first() {
            Some(first) if first.step.half => self.len / 2,
            _ => self.len,
        }
    }

    /// The radix of the first pass.
    pub(crate) fn first_radix(&self) -> usize {
        self.passes.first().map_or(1, |p| p.step.radix)
    }

    /// Transforms the bundle that `load(index)` reads; `store(index, value)` receives the result.
    /// Both tiles are overwritten. All reads of the input happen before any write of the result.
    #[inline(always)]
    pub(crate) fn process<S: Simd>(
        &self,
        simd: S,
        tiles: [Tile<'_, T>; 2],
        load: impl Fn(usize) -> Complex<T::Native<S>>,
        store: impl FnMut(usize, Complex<T::Native<S>>),
    ) {
        let tiles = self.all_but_last(simd, tiles, load);
        let done = self.passes.len().saturating_sub(1);
        self.remaining(simd, done, tiles, store);
    }

    /// All passes but the last; the tile with the result, then the other.
    #[inline(always)]
    pub(crate) fn all_but_last<'a, S: Simd>(
        &self,
        simd: S,
        [mut at, mut other]: [Tile<'a, T>; 2],
        load: impl Fn(usize) -> Complex<T::Native<S>>,
    ) -> [Tile<'a, T>; 2] {
        let put = inlined(
            #[inline(always)]
            |i, v| at.put(simd, i, v),
        );
        let last = self.passes.len().saturating_sub(1);
        let mut done = 0;
        if last > 0 && self.passes[0].step.streams() {
            let Pass { step, twiddles } = &self.passes[0];
            match (step.half, step.radix) {
                (true, 8) => pass_from_half::<S, T, 4>(simd, self.len, twiddles, load, put),
                (true, _) => pass_from_half::<S, T, 8>(simd, self.len, twiddles, load, put),
                (false, 4) => pass::<S, T, 4>(simd, self.len, 1, twiddles, load, put),
                (false, _) => pass::<S, T, 8>(simd, self.len, 1, twiddles, load, put),
            }
            done = 1;
        } else {
            for i in 0..self.len {
                put(i, load(i));
            }
        }
        while done < last {
            self.middle(simd, done, [at, other]);
            std::mem::swap(&mut at, &mut other);
            done += 1;
        }
        [at, other]
    }

    /// The passes from number `done` on, of data in the first tile.
    #[inline(always)]
    fn remaining<S: Simd>(
        &self,
        simd: S,
        mut done: usize,
        [mut at, mut other]: [Tile<'_, T>; 2],
        mut store: impl FnMut(usize, Complex<T::Native<S>>),
    ) {
        let count = self.passes.len();
        let streams = done < count && self.passes[count - 1].step.streams();
        while done + usize::from(streams) < count {
            self.middle(simd, done, [at, other]);
            std::mem::swap(&mut at, &mut other);
            done += 1;
        }
        let read = inlined(
            #[inline(always)]
            |i| at.get(simd, i),
        );
        if !streams {
            for i in 0..self.len {
                store(i, read(i));
            }
            return;
        }
        let RadixStep { radix, half } = self.passes[count - 1].step;
        let stride = self.len / radix;
        match (half, radix) {
            (true, 8) => pass_to_half::<S, T, 4>(simd, stride, self.first_output, read, store),
            (true, _) => pass_to_half::<S, T, 8>(simd, stride, self.first_output, read, store),
            (false, 4) => pass::<S, T, 4>(simd, radix, stride, &[], read, store),
            (false, _) => pass::<S, T, 8>(simd, radix, stride, &[], read, store),
        }
    }

    /// Pass number `done`, from the first tile to the second.
    #[inline(always)]
    fn middle<S: Simd>(&self, simd: S, done: usize, tiles: [Tile<'_, T>; 2]) {
        let stride: usize = self.passes[..done].iter().map(|p| p.step.radix).product();
        let Pass { step, twiddles } = &self.passes[done];
        let rest = self.len / stride;
        middle_pass(simd, step.radix, rest, stride, twiddles, tiles);
    }

    /// From lines that lack the last pass of the transform there, through the sum of their products
    /// with the fixed spectra (see [`turning_pass`]), to the transform of that sum; `self` is the
    /// transform back of a [`LaneFft::pair`].
    #[inline(always)]
    pub(crate) fn turn<S: Simd>(
        &self,
        simd: S,
        lines: &[(Tile<'_, T>, &[T])],
        fixed_stride: usize,
        tiles: [Tile<'_, T>; 2],
        store: impl FnMut(usize, Complex<T::Native<S>>),
    ) {
        let radix = self.first_radix();
        let blocks = self.len / radix;
        let twiddles = self.passes.first().map_or(&[][..], |p| &p.twiddles);
        match radix {
            1 => turning_pass::<S, T, 1>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
            2 => turning_pass::<S, T, 2>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
            3 => turning_pass::<S, T, 3>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
            4 => turning_pass::<S, T, 4>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
            5 => turning_pass::<S, T, 5>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
            _ => turning_pass::<S, T, 8>(simd, blocks, twiddles, lines, fixed_stride, tiles[0]),
        }
        self.remaining(simd, 1, tiles, store);
    }
}

/// [`LaneFft::process`] from one bundle to another, while the bundle that begins `next` numbers
/// after the first is on its way to the nearest cache, and that after the second too if its number
/// is not zero. Not inlined: it is the same for most transforms.
#[simd]
pub(crate) fn transform<S: Simd, T: Real>(
    simd: S,
    fft: &LaneFft<T>,
    tiles: [Tile<'_, T>; 2],
    from: Line<'_, T>,
    to: Line<'_, T>,
    [next, next_to]: [usize; 2],
) {
    fft.process(
        simd,
        tiles,
        #[inline(always)]
        |i| {
            from.fetch::<S>(i, next);
            from.get(simd, i)
        },
        #[inline(always)]
        |i, v| {
            if next_to > 0 {
                to.fetch::<S>(i, next_to);
            }
            to.put(simd, i, v);
        },
    );
}

/// [`LaneFft::all_but_last`] of a bundle, while `ahead` is on its way to the second-level cache.
/// Not inlined, as [`transform`].
#[simd]
pub(crate) fn first_passes<'a, S: Simd, T: Real>(
    simd: S,
    fft: &LaneFft<T>,
    tiles: [Tile<'a, T>; 2],
    from: Line<'_, T>,
    ahead: &[T],
) -> [Tile<'a, T>; 2] {
    // A little with every element: all at once would hold up what is asked for meanwhile.
    let share = ahead.len().div_ceil(fft.reads());
    fft.all_but_last(
        simd,
        tiles,
        #[inline(always)]
        |i| {
            ask_for(ahead, i * share, share);
            from.get(simd, i)
        },
    )
}

/// One pass of any radix from tile to tile. Not inlined: it is the same for all transforms.
#[simd]
fn middle_pass<S: Simd, T: Real>(
    simd: S,
    radix: usize,
    rest: usize,
    stride: usize,
    twiddles: &[[T; 2]],
    [from, to]: [Tile<'_, T>; 2],
) {
    let load = inlined(
        #[inline(always)]
        |i| from.get(simd, i),
    );
    let store = inlined(
        #[inline(always)]
        |i, v| to.put(simd, i, v),
    );
    match radix {
        2 => pass::<S, T, 2>(simd, rest, stride, twiddles, load, store),
        3 => pass::<S, T, 3>(simd, rest, stride, twiddles, load, store),
        4 => pass::<S, T, 4>(simd, rest, stride, twiddles, load, store),
        5 => pass::<S, T, 5>(simd, rest, stride, twiddles, load, store),
        _ => pass::<S, T, 8>(simd, rest, stride, twiddles, load, store),
    }
}

/// What is known of both ends of a transform, and how its passes must begin and end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct LineEnds {
    /// The second half of the input is zero and not read.
    pub(crate) from_half: bool,
    /// The second half of the output is not wanted and not written.
    pub(crate) to_half: bool,
    /// The radix of the first pass, and of the last.
    pub(crate) first: Option<usize>,
    pub(crate) last: Option<usize>,
}

/// One pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RadixStep {
    pub(crate) radix: usize,
    /// Half of the inputs (of a first pass) or of the outputs (of a last one) are left out.
    pub(crate) half: bool,
}

/// Radices of the passes with their cost per element, compared with radix 2; then of those that
/// leave out half of their inputs or outputs.
const WHOLE: [(usize, f64); 5] = [(8, 1.9), (4, 1.3), (5, 1.75), (3, 1.25), (2, 1.0)];
const HALF: [(usize, f64); 2] = [(16, 2.1), (8, 1.5)];

/// Cost of a pass that only copies: at an end whose pass does not read or write by itself.
const COPY: f64 = 0.9;

impl RadixStep {
    /// Whether the pass reads the input, or writes the result, by itself.
    pub(crate) fn streams(self) -> bool {
        self.half || matches!(self.radix, 4 | 8)
    }

    fn cost(self) -> f64 {
        let known: &[_] = if self.half { &HALF } else { &WHOLE };
        let found = known.iter().find(|r| r.0 == self.radix);
        found.map_or(0.0, |r| r.1)
    }
}

/// The cheapest passes for a transform; `None` if `len` is zero, has a prime factor above 5, or no
/// passes end as asked.
pub(crate) fn steps(len: usize, ends: LineEnds) -> Option<Vec<RadixStep>> {
    let mut best: Option<(f64, Vec<RadixStep>)> = None;
    let mut offer = |steps: Vec<RadixStep>| {
        let cost = cost(&steps);
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, steps));
        }
    };
    let whole = |radix| RadixStep { radix, half: false };
    if len == 1
        && [ends.first, ends.last]
            .iter()
            .all(|r| r.is_none_or(|r| r == 1))
    {
        offer(Vec::new());
    }
    for first in candidates(len, ends.first, ends.from_half) {
        let rest = len / first.radix;
        if rest == 1 && !first.half && ends.last.is_none_or(|r| r == len) {
            offer(vec![first]);
        }
        for last in candidates(rest, ends.last, ends.to_half) {
            if let Some(middle) = middle(rest / last.radix) {
                let middle = middle.into_iter().map(whole);
                offer([first].into_iter().chain(middle).chain([last]).collect());
            }
        }
    }
    best.map(|b| b.1)
}

/// Whether a transform of this length has passes at all.
pub(crate) fn is_supported_length(len: usize) -> bool {
    steps(len, LineEnds::default()).is_some()
}

/// Passes there and back such that the last radix there is the first one back: with two transforms
/// there for each one back, the cheapest.
pub(crate) fn turning_steps(
    len: usize,
    from_half: bool,
    to_half: bool,
) -> Option<[Vec<RadixStep>; 2]> {
    let pair = |radix: usize| {
        let there = LineEnds {
            from_half,
            last: Some(radix),
            ..LineEnds::default()
        };
        let back = LineEnds {
            to_half,
            first: Some(radix),
            ..LineEnds::default()
        };
        Some([steps(len, there)?, steps(len, back)?])
    };
    [1, 2, 3, 4, 5, 8]
        .into_iter()
        .filter_map(pair)
        .min_by(|[a, b], [c, d]| {
            let cost = |there: &[RadixStep], back: &[RadixStep]| 2.0 * cost(there) + cost(back);
            cost(a, b).total_cmp(&cost(c, d))
        })
}

/// Passes that a transform of `len` points may begin or end with.
fn candidates(len: usize, asked: Option<usize>, half: bool) -> impl Iterator<Item = RadixStep> {
    let halves = HALF.iter().filter(move |_| half && asked.is_none());
    let halves = halves.map(|(radix, _)| RadixStep {
        radix: *radix,
        half: true,
    });
    let whole = WHOLE.iter().map(|(radix, _)| RadixStep {
        radix: *radix,
        half: false,
    });
    let whole = whole.filter(move |s| asked.is_none_or(|r| r == s.radix));
    halves
        .chain(whole)
        .filter(move |s| len > 0 && len.is_multiple_of(s.radix))
}

/// Radices of product `len`, large ones first.
fn middle(len: usize) -> Option<Vec<usize>> {
    let mut rest = len;
    let mut radices = Vec::new();
    for radix in [8, 4, 2, 5, 3] {
        while rest > 0 && rest.is_multiple_of(radix) {
            rest /= radix;
            radices.push(radix);
        }
    }
    (rest == 1).then_some(radices)
}

/// Cost per element, compared with a pass of radix 2.
pub(crate) fn cost(steps: &[RadixStep]) -> f64 {
    let copies = match steps {
        [] => 2,
        [_] => 1,
        [first, .., last] => usize::from(!first.streams()) + usize::from(!last.streams()),
    };
    steps.iter().map(|s| s.cost()).sum::<f64>() + COPY * copies as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correlate::kernels::tile::Buffer;
    use crate::vectors::{dispatch_lanes, levels};
    use fearless_simd::Level;
    use num_complex::Complex as Number;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};
    use rustfft::FftPlanner;

    /// Transforms one bundle of lines, given and returned as `[element][re, im][lane]`.
    #[simd]
    fn bundle<S: Simd, T: Real>(simd: S, fft: &LaneFft<T>, lines: &mut Buffer<T>) -> usize {
        let lanes = T::Native::<S>::LEN;
        let mut tiles: [Buffer<T>; 2] =
            std::array::from_fn(|_| Buffer::zeroed(2 * lanes * fft.len));
        let [a, b] = &mut tiles;
        let (a, b, at) = (a.tile(), b.tile(), lines.tile());
        let places: Vec<_> = (0..fft.len).map(|i| 2 * lanes * i).collect();
        let at = Line::new(at, 0, &places);
        transform(simd, fft, [a, b], at, at, [0, 0]);
        lanes
    }

    /// Relative L2 distance of all lanes from rustfft in double precision. What may not be read is
    /// there all the same, and what may not be written must stay.
    fn error<T: Real>(
        level: Level,
        len: usize,
        ends: LineEnds,
        first: usize,
        rng: &mut SmallRng,
    ) -> f64 {
        let mut lines = Buffer::<T>::zeroed(2 * 16 * len);
        let random = || T::nearest(rng.random_range(-1.0..1.0));
        lines.as_mut_slice().fill_with(random);
        let before: Vec<f64> = lines.as_slice().iter().map(|v| (*v).into()).collect();
        let ours = LaneFft::<T>::new(len, ends)
            .unwrap()
            .with_first_output(first);
        let lanes = dispatch_lanes!(level, simd => bundle(simd, &ours, &mut lines));
        let fft = FftPlanner::new().plan_fft_inverse(len);
        // A plan may do without leaving out halves.
        let mut steps = ours.passes.iter().map(|p| p.step);
        let kept = |half: bool| if half { len / 2 } else { len };
        let half = |s: Option<RadixStep>| s.is_some_and(|s| s.half);
        let read = kept(ends.from_half && half(steps.clone().next()));
        let written = kept(ends.to_half && half(steps.next_back()));
        let (mut wrong, mut size) = (0.0, 0.0);
        for lane in 0..lanes {
            let at = |i: usize, part: usize| (2 * i + part) * lanes + lane;
            let mut line = vec![Number::default(); len];
            for (i, v) in line[..read].iter_mut().enumerate() {
                *v = Number::new(before[at(i, 0)], before[at(i, 1)]);
            }
            fft.process(&mut line);
            for (i, exact) in line.iter().enumerate() {
                let found = [0, 1].map(|part| lines.as_slice()[at(i, part)].into());
                if (i + len - first) % len < written {
                    wrong += (Number::new(found[0], found[1]) - exact).norm_sqr();
                    size += exact.norm_sqr();
                } else {
                    assert_eq!(found, [0, 1].map(|part| before[at(i, part)]));
                }
            }
        }
        (wrong / size).sqrt()
    }

    /// Every length with the factors 2, 3 and 5 up to 512, whole and with halves left out, any half
    /// of the output, with each kind of vectors, against rustfft. Rounding grows like the root of
    /// the number of passes: a few times 6e-8 in f32 and 1.1e-16 in f64.
    #[test]
    fn equals_rustfft_for_all_lengths() {
        let mut rng = SmallRng::seed_from_u64(4);
        let mut seen = 0;
        let longest = if cfg!(miri) { 40 } else { 512 };
        for len in (1..=longest).filter(|n| is_supported_length(*n)) {
            seen += 1;
            for (from_half, to_half) in [(false, false), (true, false), (false, true)] {
                let ends = LineEnds {
                    from_half,
                    to_half,
                    ..LineEnds::default()
                };
                let first = if to_half { rng.random_range(0..len) } else { 0 };
                for level in levels() {
                    let single = error::<f32>(level, len, ends, first, &mut rng);
                    let double = error::<f64>(level, len, ends, first, &mut rng);
                    assert!(single < 4e-7, "{len}, {ends:?}, {first}: {single}");
                    assert!(double < 8e-16, "{len}, {ends:?}, {first}: {double}");
                }
            }
        }
        let expected = if cfg!(miri) { 21 } else { 68 };
        assert_eq!(seen, expected, "lengths of the form 2^a 3^b 5^c");
    }

    fn product(steps: &[RadixStep]) -> usize {
        steps.iter().map(|s| s.radix).product()
    }

    #[test]
    fn radices_multiply_to_the_length_or_there_are_none() {
        for len in 1..2000 {
            match steps(len, LineEnds::default()) {
                Some(s) => assert_eq!(product(&s), len),
                None => assert!((7..=len).any(|p| len % p == 0 && p % 2 * (p % 3) * (p % 5) > 0)),
            }
            for (from_half, to_half) in [(false, false), (true, false), (false, true), (true, true)]
            {
                let Some([there, back]) = turning_steps(len, from_half, to_half) else {
                    assert!(!is_supported_length(len), "{len}");
                    continue;
                };
                assert_eq!((product(&there), product(&back)), (len, len));
                let turn = |s: Option<&RadixStep>| s.map_or(1, |s| s.radix);
                assert_eq!(turn(there.last()), turn(back.first()), "{len}");
                // Only the outer ends may leave out halves.
                assert!(
                    there.iter().skip(1).all(|s| !s.half)
                        && (from_half || !there[..1.min(there.len())].iter().any(|s| s.half))
                );
                assert!(
                    back.iter().rev().skip(1).all(|s| !s.half)
                        && (to_half || back.last().is_none_or(|s| !s.half))
                );
            }
        }
        assert!(!is_supported_length(0));
    }

    #[test]
    fn halves_are_left_out_where_that_saves_a_pass() {
        let radices = |len, from_half| -> Vec<usize> {
            let ends = LineEnds {
                from_half,
                ..LineEnds::default()
            };
            let steps = steps(len, ends).unwrap();
            steps.iter().map(|s| s.radix).collect()
        };
        assert_eq!(radices(128, true), [16, 8]);
        assert_eq!(radices(128, false).len(), 3);
        assert_eq!(radices(64, false), [8, 8]);
    }
}
