//! Spectra of the fixed fields, made once: the only place that names an FFT library.
//!
//! Nothing here is normalized. "Negative" means the kernel `e^{-2 pi i k x / n}`.

use std::f64::consts::PI;

use ndarray::{Array3, ArrayViewMut1, Axis};
use num_complex::Complex;
use rustfft::FftPlanner;

use crate::correlate::real::Real;

/// The negative-exponent transform of a complex field, in place.
pub(crate) fn transform_negative<T: Real>(field: &mut Array3<Complex<T>>) {
    for axis in 0..3 {
        transform_axis(field, Axis(axis));
    }
}

fn transform_axis<T: Real>(field: &mut Array3<Complex<T>>, axis: Axis) {
    let fft = FftPlanner::new().plan_fft_forward(field.len_of(axis));
    let mut line = vec![Complex::default(); fft.len()];
    let mut scratch = vec![Complex::default(); fft.get_inplace_scratch_len()];
    let each = |mut lane: ArrayViewMut1<Complex<T>>| {
        line.iter_mut().zip(&lane).for_each(|(a, b)| *a = *b);
        fft.process_with_scratch(&mut line, &mut scratch);
        lane.iter_mut().zip(&line).for_each(|(a, b)| *a = *b);
    };
    field.lanes_mut(axis).into_iter().for_each(each);
}

/// The negative-exponent spectrum of a field's real (`part` 0) or imaginary (1) part, of even
/// length `nz` along z, at the frequencies `2 k + 1/2`, k below `nz / 2`, along z (see the folder's
/// page) and all whole ones along x and y.
pub(super) fn negative_spectrum<T: Real>(
    field: &Array3<Complex<T>>,
    part: usize,
) -> Array3<Complex<T>> {
    let (nx, ny, nz) = field.dim();
    let half = nz / 2;
    let twist: Vec<Complex<T>> = (0..half)
        .map(|z| -PI * z as f64 / nz as f64)
        .map(|angle| Complex::new(T::nearest(angle.cos()), T::nearest(angle.sin())))
        .collect();
    let value = |x, y, z| {
        let v: Complex<T> = field[[x, y, z]];
        if part == 0 { v.re } else { v.im }
    };
    let mut spectrum = Array3::from_shape_fn([nx, ny, half], |(x, y, z)| {
        Complex::new(value(x, y, z), -value(x, y, z + half)) * twist[z]
    });
    transform_negative(&mut spectrum);
    spectrum
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;

    use super::*;

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
