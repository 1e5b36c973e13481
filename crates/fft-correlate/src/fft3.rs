//! One-dimensional transforms of many lines, the three-dimensional transform made of them, and
//! good sizes. The only file that names an FFT library.
//!
//! Nothing here is normalized: a forward and an inverse transform multiply by the number of
//! points. "Positive" means the kernel `e^{+2 pi i k x / n}`, "negative" its conjugate.

use std::sync::Arc;

use ndarray::{Array3, ArrayViewMut1, Axis};
use num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner};
use rustfft::{Fft, FftDirection, FftPlanner};

/// Transforms of complex lines of one length with the positive exponent.
pub(crate) struct Lines {
    fft: Arc<dyn Fft<f32>>,
}

impl Lines {
    pub(crate) fn new(len: usize) -> Self {
        Self {
            fft: FftPlanner::new().plan_fft(len, FftDirection::Inverse),
        }
    }

    /// Complex numbers of scratch that [`Lines::process`] needs.
    pub(crate) fn scratch_len(&self) -> usize {
        self.fft.get_inplace_scratch_len()
    }

    /// Transforms each of the consecutive lines in `lines` in place.
    pub(crate) fn process(&self, lines: &mut [Complex32], scratch: &mut [Complex32]) {
        self.fft.process_with_scratch(lines, scratch);
    }
}

/// Transforms of half spectra (`len / 2 + 1` values) of real lines to the lines, with the positive
/// exponent.
pub(crate) struct RealLines {
    fft: Arc<dyn ComplexToReal<f32>>,
}

impl RealLines {
    pub(crate) fn new(len: usize) -> Self {
        Self {
            fft: RealFftPlanner::new().plan_fft_inverse(len),
        }
    }

    /// Complex numbers of scratch that [`RealLines::process`] needs.
    pub(crate) fn scratch_len(&self) -> usize {
        self.fft.get_scratch_len()
    }

    /// Transforms one half spectrum, which is destroyed, to its real line.
    pub(crate) fn process(
        &self,
        half: &mut [Complex32],
        line: &mut [f32],
        scratch: &mut [Complex32],
    ) {
        // Rounding leaves tiny imaginary parts where a real line has none.
        half[0].im = 0.0;
        if line.len().is_multiple_of(2) {
            half[line.len() / 2].im = 0.0;
        }
        self.fft
            .process_with_scratch(half, line, scratch)
            .expect("lengths are fixed by the plan and the purely real entries are real");
    }
}

/// The negative-exponent transform of a complex field, in place.
pub(crate) fn transform_negative(field: &mut Array3<Complex32>) {
    let mut planner = FftPlanner::new();
    for axis in 0..3 {
        let fft = planner.plan_fft_forward(field.len_of(Axis(axis)));
        let mut line = vec![Complex32::default(); fft.len()];
        let mut scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        let each = |mut lane: ArrayViewMut1<Complex32>| {
            line.iter_mut().zip(&lane).for_each(|(a, b)| *a = *b);
            fft.process_with_scratch(&mut line, &mut scratch);
            lane.iter_mut().zip(&line).for_each(|(a, b)| *a = *b);
        };
        field.lanes_mut(Axis(axis)).into_iter().for_each(each);
    }
}

/// The cheapest transform length that is at least `min`: a product of 2, 3, 5 and 7, even when
/// `even`.
pub(crate) fn good_length(min: usize, even: bool) -> usize {
    let min = min.max(1);
    // A power of two lies below 2 * min, so the range is never empty.
    (min..=2 * min)
        .filter(|n| !even || n.is_multiple_of(2))
        .filter_map(|n| Some((line_cost(n)?, n)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(2 * min, |(_, n)| n)
}

/// Relative cost of a three-dimensional transform against one axis' length `n`, or `None` where
/// `n` has a prime factor above 7. The weights are operations per point of a radix pass; the other
/// two axes cost about `2 log2 n` per point and grow with `n` too.
fn line_cost(n: usize) -> Option<f64> {
    let (mut rest, mut passes) = (n, 0.0);
    for (prime, weight) in [(2, 1.0), (3, 1.8), (5, 2.9), (7, 4.2)] {
        while rest.is_multiple_of(prime) {
            rest /= prime;
            passes += weight;
        }
    }
    (rest == 1).then(|| n as f64 * (passes + 2.0 * (n as f64).log2() + 4.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_lengths_are_smooth_and_large_enough() {
        for min in 1..2000 {
            for even in [false, true] {
                let n = good_length(min, even);
                assert!(n >= min && n <= 2 * min, "{min} -> {n}");
                assert!(line_cost(n).is_some() && (!even || n.is_multiple_of(2)));
            }
        }
    }

    /// A plane wave becomes one peak at its frequency.
    #[test]
    fn the_transform_has_the_negative_exponent_and_no_factor() {
        let shape = [3, 4, 5];
        let wave = [2usize, 1, 3];
        let mut field = Array3::from_shape_fn(shape, |(i, j, k)| {
            let turns = |a: usize, x: usize| (wave[a] * x) as f32 / shape[a] as f32;
            Complex32::cis(std::f32::consts::TAU * (turns(0, i) + turns(1, j) + turns(2, k)))
        });
        transform_negative(&mut field);
        for (at, value) in field.indexed_iter() {
            let peak = if at == wave.into() { 60.0 } else { 0.0 };
            assert!((value - peak).norm() < 1e-4, "{at:?}: {value}");
        }
    }
}
