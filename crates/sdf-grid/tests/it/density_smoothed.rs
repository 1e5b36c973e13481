//! Fields smoothed by a Gaussian, against the closed form next to a wide face and against sums over
//! a much finer lattice.

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use sdf_grid::shapes::{PegInHole, cuboid};
use sdf_grid::{
    DensityError, DensityField, DensityKernel, DensityOptions, Lattice, Sampling, Silent,
    TriangleMesh,
};

use crate::common::relative_l2;

const SPACING: f64 = 1e-3;

/// Frames in which faces lie along the lattice, anywhere in its cells, and across it.
fn frames() -> [(DQuat, DVec3); 3] {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -0.7, 0.5));
    [
        (DQuat::IDENTITY, DVec3::ZERO),
        (DQuat::IDENTITY, DVec3::new(3.1e-4, 1.7e-4, -4.3e-4)),
        (turn, DVec3::new(-0.011, 0.002, 0.0071)),
    ]
}

fn computed(mesh: &TriangleMesh, lattice: &Lattice, sampling: Sampling) -> DensityField {
    let options = DensityOptions {
        tolerance: 1e-3,
        sampling,
        halo: 0.02,
    };
    let kernel = DensityKernel::new(0.2).unwrap();
    DensityField::compute(mesh, &kernel, lattice, &options, &Silent).unwrap()
}

/// Sharpened by `sharpening` times twice the variance.
fn smoothed(deviation: f64, sharpening: f64) -> Sampling {
    Sampling::Smoothed {
        deviation,
        sharpening: 2.0 * deviation * deviation * sharpening,
    }
}

/// Distribution of the normal distribution by adding up its density.
fn below(z: f64) -> f64 {
    let steps = 400;
    let step = z / f64::from(steps);
    let at = |i: i32| (-0.5 * ((f64::from(i) + 0.5) * step).powi(2)).exp();
    0.5 + (0..steps).map(at).sum::<f64>() * step / (2.0 * std::f64::consts::PI).sqrt()
}

/// Within 2.5 mm of the middle of a face 24 mm wide the kernel sees nothing but the face; what is
/// left is the fine lattice, most where a face takes the same part of all of its cells: 3 % of the
/// jump.
#[test]
fn next_to_a_wide_face_it_is_the_normal_distribution() {
    let (a, b) = (-0.069830, 0.531771);
    let (outer, inner) = (Complex64::new(a, -b), Complex64::new(a, b));
    for (turn, shift) in frames() {
        let part = cuboid(DVec3::splat(0.024))
            .unwrap()
            .transformed(turn, shift);
        let middle = turn * DVec3::new(0.012, 0.0, 0.0) + shift;
        let origin = middle - SPACING * DVec3::new(3.2, 2.9, 3.1);
        let lattice = Lattice::new(origin, SPACING, [7, 7, 7]).unwrap();
        for (deviation, sharpening) in
            [(0.5e-3, 0.0), (0.7e-3, 0.0), (0.7e-3, 1.0), (0.7e-3, 1.255)]
        {
            let field = computed(&part, &lattice, smoothed(deviation, sharpening));
            let (mut worst, mut count) = (0f64, 0);
            for flat in 0..lattice.len() {
                let index = lattice.unravel(flat);
                let p = turn.conjugate() * (lattice.position(index) - middle);
                if p.y.abs().max(p.z.abs()) > 2.5e-3 || p.x.abs() > 2.5e-3 {
                    continue;
                }
                count += 1;
                let z = p.x / deviation;
                let bump = z * (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
                let out = below(z) + sharpening * bump;
                let wide = |v: num_complex::Complex32| Complex64::new(v.re.into(), v.im.into());
                let found = [field.exterior[index], field.interior[index]].map(wide);
                let expected = [outer * out, inner * (1.0 - out)];
                for (f, e) in found.into_iter().zip(expected) {
                    worst = worst.max((f - e).norm());
                }
            }
            assert!(count > 50, "{count}");
            assert!(worst < 1.5e-2, "{deviation} {sharpening} {turn}: {worst:e}");
        }
    }
}

/// Around edges and corners of a peg with a key, where there is no closed form: Gaussian sums over
/// cells of an eighth of the spacing. There densities vary as much within a cell of the fine lattice
/// as from one to the next, which leaves up to 3 %.
#[test]
fn it_is_the_sum_over_a_finer_lattice() {
    let deviation = 0.7e-3;
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    for (turn, shift) in frames() {
        let part = peg.transformed(turn, shift);
        let corner = turn * DVec3::new(0.014, 0.004, 0.015) + shift;
        let lattice = Lattice::new(corner - 1.5 * SPACING, SPACING, [4, 4, 4]).unwrap();
        let field = computed(&part, &lattice, smoothed(deviation, 0.0));
        let (step, margin) = (SPACING / 8.0, 4.0 * deviation);
        let count = ((3.0 * SPACING + 2.0 * margin) / step).ceil() as usize + 1;
        let origin = lattice.origin() - margin;
        let fine = Lattice::new(origin, step, [count; 3]).unwrap();
        let points = computed(&part, &fine, Sampling::CellAverage);
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        for flat in 0..lattice.len() {
            let index = lattice.unravel(flat);
            let at = lattice.position(index);
            let (mut sums, mut weights) = ([Complex64::ZERO; 2], 0.0);
            for flat in 0..fine.len() {
                let near = fine.unravel(flat);
                let squared = fine.position(near).distance_squared(at);
                let weight = (-0.5 * squared / (deviation * deviation)).exp();
                weights += weight;
                for (sum, part) in sums.iter_mut().zip([&points.exterior, &points.interior]) {
                    let v = part[near];
                    *sum += Complex64::new(v.re.into(), v.im.into()) * weight;
                }
            }
            expected.extend(sums.map(|s| s / weights));
            let wide = |v: num_complex::Complex32| Complex64::new(v.re.into(), v.im.into());
            found.extend([field.exterior[index], field.interior[index]].map(wide));
        }
        let error = relative_l2(expected.into_iter().zip(found));
        println!("{turn}: {error:.1e}");
        assert!(error < 3e-2, "{turn}: {error:e}");
    }
}

#[test]
fn deviations_that_a_lattice_cannot_hold_are_refused() {
    let lattice = Lattice::new(DVec3::splat(-0.02), SPACING, [5, 5, 5]).unwrap();
    let part = cuboid(DVec3::splat(0.01)).unwrap();
    let kernel = DensityKernel::new(0.2).unwrap();
    for deviation in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-6, 1.0] {
        let options = DensityOptions {
            sampling: smoothed(deviation, 0.0),
            ..DensityOptions::default()
        };
        let found = DensityField::compute(&part, &kernel, &lattice, &options, &Silent);
        let name = "deviation";
        assert!(
            matches!(found, Err(DensityError::Option { name: n, .. }) if n == name),
            "{deviation}"
        );
    }
}
