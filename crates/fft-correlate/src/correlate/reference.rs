//! Windowed correlation by whole three-dimensional transforms in double precision: any size, and
//! the measure of the kernels.

use ndarray::{Array3, s};
use num_complex::Complex;

use super::kernels::transform_negative;

/// `Re sum_i A[i] B[i - n]` for `n` from 0 on in a window, indices taken modulo the period: the
/// shape of `fixed`. `moving` begins at index 0.
pub(super) fn correlate(
    mut fixed: Array3<Complex<f64>>,
    moving: &Array3<Complex<f64>>,
    window: [usize; 3],
) -> Array3<f64> {
    let points = fixed.len() as f64;
    let mut padded = Array3::<Complex<f64>>::zeros(fixed.raw_dim());
    let (x, y, z) = moving.dim();
    let mut to = padded.slice_mut(s![..x, ..y, ..z]);
    to.zip_mut_with(moving, |to, v| *to = v.conj());
    transform_negative(&mut fixed);
    transform_negative(&mut padded);
    // The conjugate of the spectrum, whose transform is the conjugate of what that of the spectrum
    // is with the positive exponent.
    fixed.zip_mut_with(&padded, |a, b| *a = (*a * b.conj()).conj());
    transform_negative(&mut fixed);
    let [x, y, z] = window;
    fixed.slice(s![..x, ..y, ..z]).mapv(|v| v.re / points)
}
