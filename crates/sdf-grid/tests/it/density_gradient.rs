//! The gradient of the density against difference quotients of the density itself.

use glam::DVec3;
use num_complex::Complex64;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Bvh, DensityGradient, DensityKernel, ReferenceDensity, TriangleMesh};

use crate::common::{self, SIGMAS, cuboid, random_points, random_star};

type Gradient = [Complex64; 3];

fn density(reference: &ReferenceDensity, p: DVec3) -> Complex64 {
    reference.unit_density(p, 1e-9).combined(1.0, 1.0)
}

/// Central difference of fourth order along `direction`.
fn difference(reference: &ReferenceDensity, p: DVec3, direction: DVec3, step: f64) -> Complex64 {
    let pair = |k: f64| {
        density(reference, p + direction * (k * step))
            - density(reference, p - direction * (k * step))
    };
    (pair(1.0) * 8.0 - pair(2.0)) / (12.0 * step)
}

fn dot(g: Gradient, v: DVec3) -> Complex64 {
    g[0] * v.x + g[1] * v.y + g[2] * v.z
}

fn distance(a: Gradient, b: Gradient) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).norm_sqr()).sum::<f64>().sqrt()
}

fn norm(a: Gradient) -> f64 {
    distance(a, Gradient::default())
}

#[test]
fn gradients_match_central_differences() {
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    let millimetres = |m: &TriangleMesh| {
        let vertices = m.vertices().iter().map(|v| *v * 50.0).collect();
        common::mesh(vertices, m.triangles().to_vec())
    };
    let meshes = [
        random_star(1, 7),
        cuboid(DVec3::splat(-0.6), DVec3::new(0.5, 0.7, 0.8), 2),
        millimetres(&peg),
    ];
    let mut compared = 0;
    for (number, mesh) in meshes.iter().enumerate() {
        let bvh = Bvh::build(mesh);
        let size = mesh.bounds().size().max_element();
        for sigma in SIGMAS {
            let kernel = DensityKernel::new(sigma).unwrap();
            let reference = ReferenceDensity::new(mesh, &kernel);
            let fast = DensityGradient::new(mesh, &kernel).unwrap();
            for p in random_points(9, 0.8, 10 + number as u64) {
                let p = mesh.bounds().center() + p * size;
                let xi = bvh.nearest(p).distance;
                let step = 1e-3 * xi;
                if xi < 0.02 * size {
                    continue;
                }
                let quotients = [step, 0.5 * step].map(|step| {
                    [DVec3::X, DVec3::Y, DVec3::Z].map(|v| difference(&reference, p, v, step))
                });
                let scale = norm(quotients[1]) + 1.0 / xi;
                // The medial axis passes by: there are no derivatives across it.
                if distance(quotients[0], quotients[1]) > 1e-6 * scale {
                    continue;
                }
                let exact = reference.unit_gradient(p).expect("off the boundary");
                let quotient = quotients[1];
                // The difference is of fourth order in a thousandth of the distance, and the kernel
                // varies over its thickness; its rounding is 1e-13 over that step.
                let found = exact.combined(1.0, 1.0);
                let error = distance(found, quotient) / scale;
                assert!(error < 1e-6, "{number} {sigma} {p}: {error:e}");
                // Both sum the same integrals, in different forms.
                let value = exact.density.combined(1.0, 1.0);
                let error = (value - density(&reference, p)).norm();
                assert!(error < 1e-8, "{number} {sigma} {p}: {error:e}");
                // Quadrature and reach of the tree code.
                let quick = fast.at(p).expect("off the boundary");
                let error = distance(quick.combined(1.0, 1.0), found) / scale;
                assert!(
                    error < 1e-5,
                    "{number} {sigma} {p}: {error:e} of the tree code"
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 40, "{compared}");
}

#[test]
fn on_a_sheet_of_the_medial_axis_it_is_the_gradient_along_the_sheet() {
    // A bar whose diagonal planes are sheets of the medial axis near its edges; the ends are within
    // the kernel's reach.
    let bar = cuboid(DVec3::new(-1.0, -1.0, -3.0), DVec3::new(1.0, 1.0, 3.0), 1);
    for sigma in SIGMAS {
        let kernel = DensityKernel::new(sigma).unwrap();
        let reference = ReferenceDensity::new(&bar, &kernel);
        let fast = DensityGradient::new(&bar, &kernel).unwrap();
        for p in [DVec3::new(0.6, 0.6, 2.58), DVec3::new(-0.5, 0.5, -2.47)] {
            let along = DVec3::new(p.x.signum(), p.y.signum(), 0.0).normalize();
            let across = DVec3::Z.cross(along);
            let exact = reference.unit_gradient(p).unwrap().combined(1.0, 1.0);
            let quick = fast.at(p).unwrap().combined(1.0, 1.0);
            // Far from the ends the density does not change along the sheet at all.
            let scale = norm(exact);
            assert!(scale > 0.1, "{sigma} {p}: {scale}");
            let error = distance(quick, exact) / scale;
            assert!(error < 1e-5, "{sigma} {p}: {error:e}");
            for v in [along, DVec3::Z] {
                // Fourth order in a thousandth of the size.
                let quotient = difference(&reference, p, v, 3e-4);
                assert!(
                    (dot(exact, v) - quotient).norm() < 1e-6 * scale,
                    "{sigma} {p} {v}"
                );
            }
            // The sheet is a plane of symmetry.
            assert!(dot(exact, across).norm() < 1e-9 * scale, "{sigma} {p}");
            // Either side has a steep slope towards the sheet: the two do not agree, and the
            // extended gradient is their mean.
            let sides = [1.0, -1.0].map(|s| {
                let q = p + across * (s * 1e-6);
                dot(
                    reference.unit_gradient(q).unwrap().combined(1.0, 1.0),
                    across,
                )
            });
            assert!((sides[0] - sides[1]).norm() > 0.5 * scale, "{sigma} {p}");
            // One millionth off the sheet.
            assert!((sides[0] + sides[1]).norm() < 1e-4 * scale, "{sigma} {p}");
        }
    }
}

#[test]
fn at_centres_of_symmetry_it_vanishes() {
    let cube = cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), 1);
    for sigma in SIGMAS {
        let kernel = DensityKernel::new(sigma).unwrap();
        let fast = DensityGradient::new(&cube, &kernel).unwrap();
        // Six nearest points around the centre; near it the density is about 1 / sigma per half
        // edge.
        assert!(norm(fast.at(DVec3::ZERO).unwrap().interior) < 1e-6 / sigma);
        let plate = cuboid(DVec3::new(-9.0, -9.0, -0.5), DVec3::new(9.0, 9.0, 0.5), 1);
        let fast = DensityGradient::new(&plate, &kernel).unwrap();
        assert!(norm(fast.at(DVec3::new(0.3, -0.2, 0.0)).unwrap().interior) < 1e-6 / sigma);
    }
}

#[test]
fn boundaries_have_none() {
    let cube = cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), 1);
    let kernel = DensityKernel::new(0.1).unwrap();
    let fast = DensityGradient::new(&cube, &kernel).unwrap();
    let places = [
        DVec3::splat(0.5),
        DVec3::new(0.5, 0.1, 0.2),
        DVec3::splat(0.4),
    ];
    let found: Vec<bool> = fast.at_all(&places).iter().map(Option::is_some).collect();
    assert_eq!(found, [false, false, true]);
}
