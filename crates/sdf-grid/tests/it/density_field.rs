//! Fields on lattices: against the reference, invariances, boundary, halo, sampling.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use glam::{DQuat, DVec3};
use ndarray::s;
use num_complex::{Complex32, Complex64};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use rayon::prelude::*;
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::{
    Aabb, DensityError, DensityField, DensityKernel, DensityOptions, Lattice, Monitor,
    ReferenceDensity, Sampling, Silent, TriangleMesh, UnitDensity, signed_distances,
};

use crate::common::{self, cuboid, random_star, relative_l2};

fn options(tolerance: f64, sampling: Sampling) -> DensityOptions {
    DensityOptions {
        tolerance,
        sampling,
        halo: f64::INFINITY,
    }
}

fn field(m: &TriangleMesh, sigma: f64, lattice: &Lattice, o: &DensityOptions) -> DensityField {
    let kernel = DensityKernel::new(sigma).unwrap();
    DensityField::compute(m, &kernel, lattice, o, &Silent).unwrap()
}

fn double(z: Complex32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into())
}

/// Relative L2 error of both parts of `f` at every `stride`-th node against the reference.
fn errors(f: &DensityField, exact: &[(usize, UnitDensity)]) -> [f64; 2] {
    let at = |i: usize| f.lattice().unravel(i);
    let exterior = exact
        .iter()
        .map(|(i, e)| (double(f.exterior[at(*i)]), e.exterior));
    let interior = exact
        .iter()
        .map(|(i, e)| (double(f.interior[at(*i)]), e.interior));
    [relative_l2(exterior), relative_l2(interior)]
}

/// Reference values at every `stride`-th node.
fn exact(
    mesh: &TriangleMesh,
    sigma: f64,
    lattice: &Lattice,
    stride: usize,
) -> Vec<(usize, UnitDensity)> {
    let reference = ReferenceDensity::new(mesh, &DensityKernel::new(sigma).unwrap());
    let step = 1e-4 * lattice.spacing();
    let nodes: Vec<usize> = (0..lattice.len()).step_by(stride).collect();
    let at = |i: usize| reference.unit_density(lattice.position(lattice.unravel(i)), step);
    nodes.into_par_iter().map(|i| (i, at(i))).collect()
}

#[test]
fn every_tolerance_is_met_against_the_reference() {
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    let meshes = [
        random_star(2, 7),
        cuboid(DVec3::splat(-0.6), DVec3::new(0.5, 0.7, 0.8), 3),
        peg,
    ];
    for mesh in &meshes {
        let size = mesh.bounds().size().max_element();
        let lattice = Lattice::covering(&mesh.bounds(), 0.4 * size, size / 12.3).unwrap();
        for sigma in common::SIGMAS {
            let exact = exact(mesh, sigma, &lattice, 37);
            for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
                let f = field(mesh, sigma, &lattice, &options(tolerance, Sampling::Point));
                let found = errors(&f, &exact);
                // What the option promises.
                assert!(
                    found.iter().all(|e| *e < tolerance),
                    "{sigma} {tolerance}: {found:?}"
                );
            }
        }
    }
}

#[test]
fn point_values_on_the_boundary_are_finite_means() {
    // Nodes on vertices, edges, faces, inside and outside of the unit cube.
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    let lattice = Lattice::new(DVec3::splat(-0.25), 0.25, [7; 3]).unwrap();
    for sigma in common::SIGMAS {
        let half = DensityKernel::new(sigma).unwrap().half_space();
        for sampling in [Sampling::Point, Sampling::CellAverage] {
            let f = field(&cube, sigma, &lattice, &options(1e-3, sampling));
            assert!(f.exterior.iter().chain(&f.interior).all(|z| z.is_finite()));
            assert!(f.signed_distance.iter().all(|d| d.is_finite()));
            assert_eq!(f.signed_distance[[1, 1, 1]], 0.0);
            assert_eq!(f.signed_distance[[3, 3, 5]], 0.0);
            assert!((f.signed_distance[[3, 3, 3]] + 0.5).abs() < 1e-6);
            assert!((f.signed_distance[[0, 0, 0]] - 0.1875f32.sqrt()).abs() < 1e-6);
        }
        let f = field(&cube, sigma, &lattice, &options(1e-4, Sampling::Point));
        let (outer, inner) = (double(f.exterior[[3, 3, 5]]), double(f.interior[[3, 3, 5]]));
        // The middle of a face; limits are taken 1e-4 spacings away.
        assert!((outer - 0.5 * half.conj()).norm() < 1e-3, "{outer}");
        assert!((inner - 0.5 * half).norm() < 1e-3, "{inner}");
    }
}

/// Values of a node do not depend on which box of nodes is computed, however it lies in the blocks.
#[test]
fn every_window_of_a_lattice_has_its_values_to_the_bit() {
    let star = random_star(2, 7);
    let (h, halo) = (0.06, 0.35);
    let whole = Lattice::covering(&star.bounds(), halo, h).unwrap();
    for sampling in [
        Sampling::Point,
        Sampling::CellAverage,
        Sampling::Smoothed {
            deviation: 0.7 * h,
            sharpening: 0.0,
        },
        Sampling::Smoothed {
            deviation: 0.7 * h,
            sharpening: 1.2 * h * h,
        },
    ] {
        let options = DensityOptions {
            halo,
            ..options(1e-3, sampling)
        };
        let dense = field(&star, 0.1, &whole, &options);
        let distances = signed_distances(&star, &whole, &Silent).unwrap();
        let mut rng = SmallRng::seed_from_u64(5);
        for _ in 0..6 {
            let shape = whole.shape().map(|n| rng.random_range(1..=n.min(30)));
            let first: [usize; 3] =
                std::array::from_fn(|a| rng.random_range(0..=whole.shape()[a] - shape[a]));
            let box_ = Aabb {
                min: whole.position(first),
                max: whole.position([0, 1, 2].map(|a| first[a] + shape[a] - 1)),
            };
            // A covering lattice of cells around these nodes.
            let window = Lattice::covering(&box_, 0.25 * h, h).unwrap();
            assert_eq!(window.shape(), shape);
            let part = field(&star, 0.1, &window, &options);
            let own = |axis: usize| first[axis]..first[axis] + shape[axis];
            let slice = s![own(0), own(1), own(2)];
            assert_eq!(part.exterior, dense.exterior.slice(slice), "{sampling:?}");
            assert_eq!(part.interior, dense.interior.slice(slice), "{sampling:?}");
            assert_eq!(part.signed_distance, dense.signed_distance.slice(slice));
            let found = signed_distances(&star, &window, &Silent).unwrap();
            assert_eq!(found, distances.slice(slice));
        }
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let star = random_star(2, 3);
    let lattice = Lattice::covering(&star.bounds(), 0.3, 0.13).unwrap();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| field(&star, 0.1, &lattice, &options(1e-3, Sampling::CellAverage)))
    };
    let one = run(1);
    for threads in [2, 5] {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}

#[test]
fn density_moves_and_scales_with_the_part() {
    let star = random_star(2, 11);
    let lattice = Lattice::covering(&star.bounds(), 0.3, 0.2).unwrap();
    let plain = field(&star, 0.1, &lattice, &options(1e-4, Sampling::Point));
    let pairs = |a: &DensityField, b: &DensityField| {
        let values = |f: &DensityField| {
            f.combined(1.0, 1.0)
                .iter()
                .map(|z| double(*z))
                .collect::<Vec<_>>()
        };
        relative_l2(values(a).into_iter().zip(values(b)))
    };
    // A quarter turn about z: node [i, j, k] goes to [-j, i, k].
    let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let shift = DVec3::new(3.0, -2.0, 1.0);
    let turned = star.transformed(turn, shift);
    let [nx, ny, nz] = lattice.shape();
    let corner = lattice.position([0, ny - 1, 0]);
    let origin = DVec3::new(-corner.y, corner.x, corner.z) + shift;
    let moved = Lattice::new(origin, lattice.spacing(), [ny, nx, nz]).unwrap();
    let mut other = field(&turned, 0.1, &moved, &options(1e-4, Sampling::Point));
    for a in [&mut other.exterior, &mut other.interior] {
        a.swap_axes(0, 1);
        a.invert_axis(ndarray::Axis(1));
    }
    // Both meet 1e-4.
    assert!(pairs(&other, &plain) < 2e-4);
    for scale in [1e-3, 7.0] {
        let vertices = star.vertices().iter().map(|v| *v * scale).collect();
        let scaled = common::mesh(vertices, star.triangles().to_vec());
        let lattice = Lattice::new(
            lattice.origin() * scale,
            lattice.spacing() * scale,
            lattice.shape(),
        );
        let f = field(
            &scaled,
            0.1,
            &lattice.unwrap(),
            &options(1e-4, Sampling::Point),
        );
        assert!(pairs(&f, &plain) < 2e-4, "{scale}");
    }
}

#[test]
fn halo_fades_the_exterior_only() {
    let star = random_star(1, 5);
    let lattice = Lattice::covering(&star.bounds(), 0.8, 0.1).unwrap();
    let whole = field(&star, 0.1, &lattice, &options(1e-4, Sampling::Point));
    let halo = 0.4;
    let o = DensityOptions {
        halo,
        ..options(1e-4, Sampling::Point)
    };
    let cut = field(&star, 0.1, &lattice, &o);
    assert_eq!(cut.interior, whole.interior);
    assert_eq!(cut.signed_distance, whole.signed_distance);
    let mut counts = [0; 3];
    for (index, d) in cut.signed_distance.indexed_iter() {
        let (found, full) = (double(cut.exterior[index]), double(whole.exterior[index]));
        let t = ((f64::from(*d) / halo - 0.7) / 0.3).clamp(0.0, 1.0);
        let factor = 1.0 - t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t);
        counts[usize::from(t > 0.0) + usize::from(t >= 1.0)] += 1;
        // Single precision of the density and of the distance in the factor.
        assert!(
            (found - full * factor).norm() < 1e-4 * full.norm() + 1e-6,
            "{d}"
        );
    }
    assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
}

#[test]
fn cell_averages_are_means_of_sub_points() {
    let cube = cuboid(DVec3::splat(-0.4), DVec3::splat(0.45), 1);
    let lattice = Lattice::new(DVec3::splat(-0.7), 0.2, [8; 3]).unwrap();
    let fine = Lattice::new(lattice.origin() - 0.075, 0.05, [32; 3]).unwrap();
    let average = field(&cube, 0.2, &lattice, &options(1e-5, Sampling::CellAverage));
    let points = field(&cube, 0.2, &lattice, &options(1e-5, Sampling::Point));
    let sub = field(&cube, 0.2, &fine, &options(1e-5, Sampling::Point));
    let mut cut = 0;
    for (index, d) in average.signed_distance.indexed_iter() {
        let (i, j, k) = index;
        let block = ndarray::s![4 * i..4 * i + 4, 4 * j..4 * j + 4, 4 * k..4 * k + 4];
        for (found, point, fine) in [
            (&average.exterior, &points.exterior, &sub.exterior),
            (&average.interior, &points.interior, &sub.interior),
        ] {
            if f64::from(d.abs()) < 0.87 * lattice.spacing() {
                let mean = fine.slice(block).mean().unwrap();
                // Both are means of 64 values that meet 1e-5; singles may miss it by a digit.
                assert!(
                    (found[index] - mean).norm() < 1e-4,
                    "{index:?} {} {mean}",
                    found[index]
                );
                cut += 1;
            } else {
                assert_eq!(found[index], point[index]);
            }
        }
    }
    assert!(cut > 100);
}

#[test]
fn bad_options_are_refused() {
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    let kernel = DensityKernel::new(0.1).unwrap();
    let lattice = Lattice::new(DVec3::ZERO, 0.5, [2; 3]).unwrap();
    let good = DensityOptions::default();
    for (o, name) in [
        (
            DensityOptions {
                tolerance: 1e-6,
                ..good
            },
            "tolerance",
        ),
        (
            DensityOptions {
                tolerance: f64::NAN,
                ..good
            },
            "tolerance",
        ),
        (DensityOptions { halo: 0.0, ..good }, "halo"),
        (
            DensityOptions {
                halo: f64::NAN,
                ..good
            },
            "halo",
        ),
    ] {
        let error = DensityField::compute(&cube, &kernel, &lattice, &o, &Silent).unwrap_err();
        assert!(
            matches!(error, DensityError::Option { name: n, .. } if n == name),
            "{error}"
        );
    }
}

#[test]
fn a_monitor_sees_every_block_and_can_cancel() {
    #[derive(Default)]
    struct Counter {
        total: AtomicU64,
        done: AtomicU64,
        stop: bool,
    }
    impl Monitor for Counter {
        fn begin(&self, _: &str, total: u64) {
            self.total.store(total, Relaxed);
        }
        fn advance(&self, steps: u64) {
            self.done.fetch_add(steps, Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.stop
        }
    }
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    let kernel = DensityKernel::new(0.1).unwrap();
    let lattice = Lattice::new(DVec3::splat(0.05), 0.1, [9, 8, 17]).unwrap();
    let run = |m: &Counter| {
        DensityField::compute(&cube, &kernel, &lattice, &DensityOptions::default(), m)
    };
    let counter = Counter::default();
    run(&counter).unwrap();
    assert_eq!(counter.total.load(Relaxed), 6);
    assert_eq!(counter.done.load(Relaxed), 6);
    let stopped = Counter {
        stop: true,
        ..Counter::default()
    };
    assert_eq!(run(&stopped).unwrap_err(), DensityError::Cancelled);
}

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
        let part = shapes::cuboid(DVec3::splat(0.024))
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
    let part = shapes::cuboid(DVec3::splat(0.01)).unwrap();
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
