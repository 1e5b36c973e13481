//! The correlation that a page of rustfft gives: complex, unpruned, one axis after the other. The
//! measure of what cropping, pruning and packing are worth, and in f64 of how exact they are.

use ndarray::{Array3, ArrayViewMut3, Axis};
use num_complex::Complex;
use rustfft::{FftDirection, FftNum, FftPlanner};

/// Transforms all lines along every axis in place; no factor.
pub fn transform<T: FftNum>(mut field: ArrayViewMut3<'_, Complex<T>>, direction: FftDirection) {
    let mut planner = FftPlanner::new();
    for axis in 0..3 {
        let fft = planner.plan_fft(field.len_of(Axis(axis)), direction);
        let mut scratch = vec![Complex::new(T::zero(), T::zero()); fft.get_inplace_scratch_len()];
        let mut line = vec![Complex::new(T::zero(), T::zero()); fft.len()];
        for mut lane in field.lanes_mut(Axis(axis)) {
            line.iter_mut().zip(&lane).for_each(|(a, b)| *a = *b);
            fft.process_with_scratch(&mut line, &mut scratch);
            lane.iter_mut().zip(&line).for_each(|(a, b)| *a = *b);
        }
    }
}

/// The spectrum of the conjugate's conjugate: with it, the product of spectra is the correlation
/// `sum over p of a(p) b(p - d)` without conjugation of the densities.
pub fn reversed_spectrum<T: FftNum>(mut moving: Array3<Complex<T>>) -> Array3<Complex<T>> {
    moving.mapv_inplace(|v| v.conj());
    transform(moving.view_mut(), FftDirection::Forward);
    moving.mapv_inplace(|v| v.conj());
    moving
}

/// `Re sum over p of a(p) b(p - d)` at every periodic displacement d, for fixed fields given by
/// their spectra.
///
/// # Panics
/// If there is no field, or the boxes differ in shape.
pub fn correlate<T: FftNum>(
    fixed_spectra: &[Array3<Complex<T>>],
    moving: Vec<Array3<Complex<T>>>,
) -> Array3<T> {
    let mut sum: Option<Array3<Complex<T>>> = None;
    for (spectrum, moving) in fixed_spectra.iter().zip(moving) {
        let product = reversed_spectrum(moving) * spectrum;
        sum = Some(match sum {
            Some(s) => s + product,
            None => product,
        });
    }
    let mut score = sum.expect("at least one product");
    transform(score.view_mut(), FftDirection::Inverse);
    let points = T::from_usize(score.len()).expect("a count is a number");
    score.mapv(|v| v.re / points)
}
