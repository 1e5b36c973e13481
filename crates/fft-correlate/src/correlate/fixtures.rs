//! For the tests of this folder: a synthetic pair, and windowed correlation by whole
//! three-dimensional transforms in double precision.

use std::sync::Arc;

use glam::DVec3;
use ndarray::{Array3, Axis, s};
use num_complex::{Complex, Complex32};
use rustfft::FftPlanner;
use sdf_grid::{DensityField, FIELD_VERSION, FieldProvenance, Lattice, Sampling};

use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;

pub(super) const H: f64 = 0.1;

/// A part that is a union of balls with made-up densities: exterior outside within a halo, interior
/// inside; smooth enough to turn, with nothing that favours an axis.
pub(super) fn part(balls: &[(DVec3, f64)], min: [i64; 3], shape: [usize; 3]) -> DensityField {
    let origin = (DVec3::from_array(min.map(|m| m as f64)) + 0.5) * H;
    let lattice = Lattice::new(origin, H, shape).unwrap();
    let distance = |p: DVec3| {
        let to = |(c, r): &(DVec3, f64)| (p - c).length() - r;
        balls.iter().map(to).fold(f64::INFINITY, f64::min)
    };
    let at = |i, j, k| distance(lattice.position([i, j, k]));
    let complex = |re: f64, im: f64| Complex32::new(re as f32, im as f32);
    DensityField {
        exterior: Array3::from_shape_fn(shape, |(i, j, k)| match at(i, j, k) {
            d if d > 0.0 && d < 0.3 => complex((d * 5.0).cos() * (0.3 - d), d - 0.3),
            _ => Complex32::default(),
        }),
        interior: Array3::from_shape_fn(shape, |(i, j, k)| match at(i, j, k) {
            d if d <= 0.0 => complex(d, 0.7 - d),
            _ => Complex32::default(),
        }),
        signed_distance: Array3::from_shape_fn(shape, |(i, j, k)| at(i, j, k) as f32),
        provenance: FieldProvenance {
            version: FIELD_VERSION,
            mesh: String::new(),
            sigma: 0.2,
            halo: 0.3,
            tolerance: 1e-3,
            sampling: Sampling::Point,
            lattice,
        },
    }
}

pub(super) fn fixed_part() -> DensityField {
    let balls = [
        (DVec3::new(0.1, 0.0, -0.2), 0.35),
        (DVec3::new(-0.35, 0.3, 0.1), 0.25),
    ];
    part(&balls, [-10, -8, -9], [18, 17, 16])
}

pub(super) fn moving_part() -> DensityField {
    let balls = [
        (DVec3::new(0.05, 0.1, 0.0), 0.25),
        (DVec3::new(0.3, 0.05, 0.15), 0.15),
    ];
    part(&balls, [-6, -5, -6], [14, 12, 13])
}

pub(super) fn pair(w: f64, pivot: DVec3) -> Pair {
    let model = ScoreModel {
        separation_weight: w,
        ..ScoreModel::GUIDED
    };
    Pair::new(
        Arc::new(fixed_part()),
        Arc::new(moving_part()),
        model,
        pivot,
    )
    .unwrap()
}

pub(super) fn window() -> TranslationWindow {
    TranslationWindow::new(DVec3::new(-0.4, -0.2, -0.9), DVec3::new(0.2, 0.5, 0.3), H).unwrap()
}

/// The negative-exponent transform of a complex field, in place, by RustFFT.
fn transform_negative(field: &mut Array3<Complex<f64>>) {
    for axis in 0..3 {
        let fft = FftPlanner::new().plan_fft_forward(field.len_of(Axis(axis)));
        for mut lane in field.lanes_mut(Axis(axis)) {
            let mut line = lane.to_vec();
            fft.process(&mut line);
            lane.iter_mut().zip(line).for_each(|(to, v)| *to = v);
        }
    }
}

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
