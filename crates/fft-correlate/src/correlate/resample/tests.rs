use fearless_simd::Level;
use fearless_simd::prelude::*;
use glam::{DQuat, DVec3};
use ndarray::Array3;
use num_complex::{Complex, Complex32, Complex64};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use super::moving_field::MovingField;
use super::rotated_field::RotatedField;
use crate::correlate::contract::MovingRows;
use crate::correlate::real::Real;
use crate::correlate::support::MovingSupport;
use crate::pair::interpolation::Interpolation;
use crate::vectors::{dispatch_lanes, levels};

/// A shell with a hole and a separate grain: full, empty and partly filled blocks.
fn field(rng: &mut SmallRng) -> Array3<Complex32> {
    Array3::from_shape_fn([33, 66, 41], |(i, j, k)| {
        let p = DVec3::new(i as f64 - 15.0, j as f64 - 12.0, k as f64 - 17.0);
        let shell = (8.0..11.0).contains(&p.length());
        let grain = (p - DVec3::new(0.0, 44.0, 0.0)).length() < 2.0;
        if shell || grain {
            Complex32::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
        } else {
            Complex32::default()
        }
    })
}

/// Largest difference between bundles and rows over all samples, and how many bundles skipped.
fn compare<T: Real>(level: Level, turned: &RotatedField<'_, T>) -> (f64, usize) {
    let lanes = dispatch_lanes!(level, simd => lanes_of::<_, T>(simd));
    let [xs, ys, zs] = turned.bounds();
    let (mut worst, mut skipped) = (0.0f64, 0);
    let mut bundle = vec![T::nearest(f64::NAN); 2 * lanes * zs.end];
    for x in xs {
        for y in ys.clone().step_by(lanes) {
            let filled = dispatch_lanes!(level, simd => turned.fill_lanes(simd, x, y, &mut bundle));
            skipped += usize::from(filled.len() < zs.len());
            for lane in 0..lanes.min(ys.end - y) {
                let mut row = vec![Complex::default(); zs.end];
                fill(turned, x, y + lane, &mut row);
                for (z, exact) in row.iter().enumerate() {
                    let mut found = Complex::default();
                    if filled.contains(&z) {
                        found.re = bundle[2 * z * lanes + lane];
                        found.im = bundle[(2 * z + 1) * lanes + lane];
                    }
                    let apart: Complex<T> = found - exact;
                    worst = worst.max(apart.l1_norm().into());
                }
            }
        }
    }
    (worst, skipped)
}

#[inline(always)]
fn lanes_of<S: Simd, T: Real>(_: S) -> usize {
    T::Native::<S>::LEN
}

/// The bundles, in which empty patches are skipped and coordinates are kept relative to a node
/// nearby, against the rows, whose coordinates are in double precision. Values are of order
/// one; f32 coordinates within 20 cells are good to 1e-6.
#[test]
fn bundles_equal_rows() {
    for interpolation in [Interpolation::Trilinear, Interpolation::Quadratic] {
        bundles_equal_rows_read(interpolation);
    }
}

fn bundles_equal_rows_read(interpolation: Interpolation) {
    let mut rng = SmallRng::seed_from_u64(6);
    let values = field(&mut rng);
    let first = DVec3::new(-15.3, -12.0, -17.8);
    let value = |at: [usize; 3]| values[at];
    let support = MovingSupport::from_field([33, 66, 41], value, first, interpolation).unwrap();
    let single = MovingField::<f32>::new(&support.nodes, value, first, interpolation);
    let double = MovingField::<f64>::new(&support.nodes, value, first, interpolation);
    let origin = DVec3::new(-30.5, -29.5, -28.5);
    for turn in 0..6 {
        let mut c = || rng.random_range(-1.0..1.0);
        let rotation = match turn {
            0 => DQuat::IDENTITY,
            1 => DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
            _ => DQuat::from_xyzw(c(), c(), c(), c()).normalize(),
        };
        // Once everything, once a box that cuts the field.
        let mut within = support.reach(origin);
        if turn % 2 == 1 {
            within.hi[1] -= 19;
            within.lo[2] += 17;
        }
        for level in levels() {
            let (worst, skipped) = compare(
                level,
                &RotatedField::new(&single, single.values(), rotation, origin, within, within),
            );
            assert!(worst < 8e-6, "{rotation}: {worst}");
            assert!(skipped > 0);
            let (worst, _) = compare(
                level,
                &RotatedField::new(&double, double.values(), rotation, origin, within, within),
            );
            assert!(worst < 1e-13, "{rotation}: {worst}");
        }
    }
}

/// Writes the values with index `[x, y, z]` to `row[z]`, with coordinates in double precision.
fn fill<T: Real>(turned: &RotatedField<'_, T>, x: usize, y: usize, row: &mut [Complex<T>]) {
    let start = turned.start + turned.step.x_axis * x as f64 + turned.step.y_axis * y as f64;
    for z in turned.bounds[2].clone() {
        let Some(taps) = turned.field.taps(start + turned.step.z_axis * z as f64) else {
            continue;
        };
        let terms = taps.map(|(node, w, _)| {
            let v = turned.field.values[node];
            let value = Complex64::new(v.re.into(), v.im.into());
            value * w.element_product()
        });
        let sum: Complex64 = terms.sum();
        row[z] = Complex::new(T::nearest(sum.re), T::nearest(sum.im));
    }
}
