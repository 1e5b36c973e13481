//! The parts of the packet code in single precision, against f64.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::DVec3;
use num_complex::Complex64;

use super::accuracy::Accuracy;
use super::density::{PacketDensity, Traversal};
use super::distance::Facet;
use super::kernel::{PacketKernel, exp};
use super::near_faces::NearFaces;
use super::points::{LANES, Lanes, Packet, Points};
use super::tree::{PacketTree, Query};
use crate::dispatch_lanes;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::field::point::edge_integral::EdgeQuadrature;
use crate::mesh::shapes::{self, PegInHole, random_solid};
use crate::support::angle::upper_angle;
use crate::support::level;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;

#[simd]
fn triangle<S: Simd>(
    simd: S,
    tree: &PacketTree<'_>,
    points: &Points,
    xi: f32,
    index: usize,
) -> [f32; 2] {
    let packet = Packet::new(simd, points);
    let query = Query::new(tree, f32x16::splat(simd, xi));
    let mut sum = [packet.splat(0.0); 2];
    let mut near = NearFaces::default();
    near.prepare(tree.bvh.faces.len());
    near.add(tree, &packet, &query, index, &mut sum);
    near.add_pending(tree, &packet, &query, &mut sum);
    [sum[0][0], sum[1][0]]
}

#[test]
fn triangles_match_the_f64_edge_integrals() {
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    let bvh = Bvh::build(&peg);
    // Lattice points: feet of perpendiculars fall close to many edges of a facetted cylinder,
    // where numerator and denominator of the edge integrand nearly vanish together.
    let places = (0..216).map(|i| DVec3::new((i / 36) as f64, (i / 6 % 6) as f64, (i % 6) as f64));
    let points: Vec<DVec3> = places.map(|p| (p - 2.5) * (1.0 / 2.05)).collect();
    for sigma in [0.05, 0.2] {
        let kernel = DensityKernel::new(sigma).unwrap();
        let table = CumulativeKernel::new(kernel);
        let tree = PacketTree::new(&bvh, &table, 1e-5);
        let exact = EdgeQuadrature::new(sigma, 8.4, 12, 0.25);
        for q in &points {
            let xi = bvh.nearest_normalized(*q).1.sqrt();
            for (i, t) in bvh.faces.iter().enumerate() {
                let expected = exact.face(&table, t, *q, xi);
                let [re, im] = dispatch_lanes!(level::native(), simd => {
                    triangle(simd, &tree, &Points::new(&[*q; LANES]), xi as f32, i)
                });
                let error = (Complex64::new(re.into(), im.into()) - expected).norm();
                // Of densities near 1, at the setting for 1e-5.
                assert!(error < 1e-5, "{sigma} {q} triangle {i}: {error:e}");
            }
        }
    }
}

/// From next to the faces, where all are near, to far away, where all are in clusters; outside and
/// inside; and between the faces of a thin plate, which cancel.
#[test]
fn single_points_match_the_f64_edge_integrals() {
    let torus = shapes::torus(1.0, 0.4, 90, 36).unwrap();
    let plate = shapes::cuboid(DVec3::new(1.0, 0.8, 0.01)).unwrap();
    for (mesh, away) in [
        (torus, [-0.1, -0.01, 1e-3, 0.03, 0.1, 0.5, 2.0]),
        (plate, [-1e-3, -4e-3, 1e-3, 0.03, 0.1, 0.5, 2.0]),
    ] {
        let bvh = Bvh::merged(
            &mesh,
            crate::surface::coplanar::pieces::EXACT,
            Leaves::Small,
        );
        for (sigma, tolerance) in [(0.05, 1e-3), (0.1, 1e-4), (0.2, 1e-5)] {
            let table = CumulativeKernel::new(DensityKernel::new(sigma).unwrap());
            let mut density = PacketDensity::new(&bvh, &table, tolerance);
            let exact = EdgeQuadrature::new(sigma, 8.4, 12, 0.25);
            let (mut wrong, mut all, mut traversal) = (0.0, 0.0, Traversal::default());
            for (i, face) in bvh
                .faces
                .iter()
                .enumerate()
                .step_by(1 + bvh.faces.len() / 20)
            {
                for away in away {
                    let point = face.centroid + face.normal * away + 0.2 * away * face.along[0];
                    let xi = bvh.nearest_normalized(point).1.sqrt();
                    let parts = bvh.faces.iter().map(|t| exact.face(&table, t, point, xi));
                    let expected: Complex64 = parts.sum();
                    for level in level::tested() {
                        density.level = level;
                        let [re, im] = density.integral(point, xi as f32, &mut traversal);
                        let found = Complex64::new(re.into(), im.into());
                        assert!(found.is_finite(), "{level:?} face {i}, {away}");
                        wrong += (found - expected).norm_sqr();
                        all += expected.norm_sqr();
                    }
                }
            }
            let error = f64::sqrt(wrong / all);
            println!("{sigma} {tolerance:e}: {error:.1e}");
            // The tolerance is that of a field.
            assert!(error < tolerance, "{sigma} {tolerance:e}: {error:e}");
        }
    }
}

/// Distances and integrals of packets all over a box of twice the part.
fn values(density: &PacketDensity<'_>) -> (Vec<Lanes>, Vec<[Lanes; 2]>) {
    let place = |i: usize| DVec3::new((i / 64) as f64, (i / 8 % 8) as f64, (i % 8) as f64);
    let corner = |i: usize| (place(i) - 3.47) * 0.5;
    let packet = |i: usize| -> Points {
        Points::new(&std::array::from_fn(|lane| {
            let step = [lane / 8, lane / 4 % 2, lane % 4].map(|k| 0.07 * k as f64);
            corner(i) + DVec3::from_array(step)
        }))
    };
    let mut traversal = Traversal::default();
    (0..512)
        .map(|i| {
            let points = packet(i);
            let distances = density.distances(&points, &mut 0);
            (
                distances,
                density.integrals(&points, &distances, &mut traversal),
            )
        })
        .unzip()
}

fn relative<'a>(found: impl Iterator<Item = (&'a f32, &'a f32)>) -> f64 {
    let (wrong, all) = found.fold((0.0, 0.0), |(e, s), (a, b)| {
        let (a, b) = (f64::from(*a), f64::from(*b));
        (e + (a - b).powi(2), s + b * b)
    });
    f64::sqrt(wrong / all)
}

#[test]
fn instruction_sets_agree() {
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    for mesh in [peg, random_solid(0).unwrap()] {
        let bvh = Bvh::merged(
            &mesh,
            crate::surface::coplanar::pieces::EXACT,
            Leaves::Small,
        );
        let table = CumulativeKernel::new(DensityKernel::new(0.1).unwrap());
        for tolerance in [1e-3, 1e-5] {
            let mut density = PacketDensity::new(&bvh, &table, tolerance);
            let (distances, integrals) = values(&density);
            for level in level::tested() {
                density.level = level;
                let found = values(&density);
                let pairs = found.0.as_flattened().iter().zip(distances.as_flattened());
                let error = relative(pairs);
                // Rounding of single precision: with and without fused multiplication.
                assert!(error < 1e-6, "{level:?} distances: {error:e}");
                let flat = |v: &[[Lanes; 2]]| v.as_flattened().as_flattened().to_vec();
                let error = relative(flat(&found.1).iter().zip(&flat(&integrals)));
                // Rounding, seen as 3e-7; and clusters at the edge of acceptance, each good to the
                // tolerance, of which few change sides.
                let bound = 3e-6 + 5e-3 * tolerance;
                assert!(error < bound, "{level:?} {tolerance}: {error:e}");
                println!("{level:?} {tolerance:e}: {error:.1e}");
            }
        }
    }
}

#[simd]
fn elementary<S: Simd>(simd: S, x: &Lanes, y: &Lanes) -> [Lanes; 2] {
    let [x, y] = [x, y].map(|v| f32x16::simd_from(simd, *v));
    [exp(x).into(), upper_angle(y.abs(), x).copysign(y).into()]
}

#[test]
fn exponentials_and_angles_are_those_of_the_standard_library() {
    for i in 0..4000 {
        let x: Lanes = std::array::from_fn(|lane| -0.0003 * (16 * i + lane + 1) as f32);
        let y: Lanes = std::array::from_fn(|lane| (0.37 * (16 * i + lane) as f32).sin() * 20.0);
        let [e, angle] = dispatch_lanes!(level::native(), simd => elementary(simd, &x, &y));
        for lane in 0..LANES {
            let (x, y) = (f64::from(x[lane]), f64::from(y[lane]));
            // The polynomial's error, and the rounding of x in units of log 2.
            let error = f64::from(e[lane]) / x.exp() - 1.0;
            assert!(error.abs() < 3e-7 + 1.2e-7 * x.abs(), "exp {x}: {error:e}");
            // The polynomial's error, and rounding of angles up to pi.
            let error = f64::from(angle[lane]) - y.atan2(x);
            assert!(error.abs() < 1e-6, "atan2 {y} {x}: {error:e}");
        }
    }
}

#[simd]
fn expansion<S: Simd>(simd: S, kernel: &PacketKernel, u: &Lanes, terms: [f32; 3]) -> [Lanes; 2] {
    let u = f32x16::simd_from(simd, *u);
    let x = (u - 1.0) * (1.0 / kernel.sigma);
    let view = [x, u, 1.0 / u, 1.0 / (u * u + 1.0)];
    let terms = terms.map(|t| f32x16::splat(simd, t));
    kernel.expansion(view, terms).map(Into::into)
}

/// The complex form against the kernel and its derivatives.
#[test]
fn expansions_are_those_of_the_radial_kernel() {
    for sigma in [0.03, 0.1, 0.5] {
        let table = CumulativeKernel::new(DensityKernel::new(sigma).unwrap());
        let kernel = PacketKernel::new(&table, &Accuracy::new(1e-5, sigma), 1e-5);
        let u: Lanes = std::array::from_fn(|lane| 1.0 + 0.3 * (sigma as f32) * lane as f32);
        // Each term alone, then all.
        for terms in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.7, -0.2, 0.01f32],
        ] {
            let found =
                dispatch_lanes!(level::native(), simd => expansion(simd, &kernel, &u, terms));
            let [flat, first, bow] = terms.map(f64::from);
            for lane in 0..LANES {
                let u = f64::from(u[lane]);
                let [g, g1, g2] = table.kernel().radial(u);
                let exact = g * flat + g1 * (first / u) + (g2 - g1 / u) * bow;
                let found = Complex64::new(found[0][lane].into(), found[1][lane].into());
                let size = g.norm() + g1.norm() + g2.norm();
                // Single precision, and the gain that makes up for the truncated kernel.
                let error = (found - exact).norm() / size;
                assert!(error < 1e-5, "{sigma} {u} {terms:?}: {found} {exact}");
            }
        }
    }
}

#[simd]
fn nearer<S: Simd>(simd: S, facet: &Facet, points: &Points, best: &Lanes) -> bool {
    let packet = Packet::new(simd, points);
    facet
        .disc
        .may_be_nearer(&packet, f32x16::simd_from(simd, *best))
}

/// Seen from close by and from far away, over a face, beside it and below it.
#[test]
fn discs_keep_every_face_that_is_nearer_and_none_that_is_far() {
    let torus = shapes::torus(1.0, 0.4, 60, 24).unwrap();
    let bvh = Bvh::merged(
        &torus,
        crate::surface::coplanar::pieces::EXACT,
        Leaves::Small,
    );
    let (mut needless, mut tried) = (0, 0);
    for (i, face) in bvh.faces.iter().enumerate().step_by(7) {
        let facet = Facet::new(face);
        for away in [1e-4, 1e-2, 0.3, 3.0] {
            let angle = 0.9 * i as f64;
            let direction = face.normal * angle.cos() + face.along[0] * angle.sin();
            let places: [DVec3; LANES] = std::array::from_fn(|lane| {
                let step = [lane / 8, lane / 4 % 2, lane % 4].map(|k| 0.06 * k as f64);
                face.centroid + direction * away + DVec3::from_array(step)
            });
            let points = Points::new(&places);
            for (lane, place) in places.iter().enumerate() {
                let exact = face.distance_squared(*place).sqrt();
                let nearer = |distance: f64| {
                    let mut best = [0.0; LANES];
                    best[lane] = (distance * distance) as f32;
                    dispatch_lanes!(level::native(), simd => nearer(simd, &facet, &points, &best))
                };
                // Farther than the face by what single precision shows.
                let room = 4e-7 * (exact + f64::from(points.half_diagonal()));
                assert!(nearer(exact + room), "face {i}, {away}, point {lane}");
                // The disc is larger than the face by its radius at most.
                let size = f64::from(facet.disc.radius);
                needless += usize::from(exact > size && nearer(0.99 * (exact - size)));
                tried += 1;
            }
        }
    }
    assert!(tried > 1000 && needless == 0, "{needless} of {tried}");
}
