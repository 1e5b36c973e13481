//! The f64 reference against oracles that share none of its code.

use glam::DVec3;
use num_complex::Complex64;
use sdf_grid::{DensityKernel, ReferenceDensity};

use crate::common::{
    self, SIGMAS, cuboid, icosphere, random_points, random_star, subdivided_density,
};

fn kernel(sigma: f64) -> DensityKernel {
    DensityKernel::new(sigma).unwrap()
}

/// Density of the part that is not zero at `p`.
fn unit(reference: &ReferenceDensity, p: DVec3) -> Complex64 {
    let density = reference.unit_density(p, 1e-6);
    density.exterior + density.interior
}

#[test]
fn large_face_is_a_half_space() {
    let slab = cuboid(DVec3::splat(-10.0), DVec3::new(10.0, 10.0, 0.0), 1);
    for sigma in SIGMAS {
        let reference = ReferenceDensity::new(&slab, &kernel(sigma));
        let half = kernel(sigma).half_space();
        for height in [1e-3, 0.1, 0.5] {
            let at = |z| reference.unit_density(DVec3::new(0.3, -0.2, z), 1e-6);
            let (outside, inside) = (at(height), at(-height));
            // Edges are beyond 8 kernel widths: only quadrature error is left.
            assert!(
                (outside.exterior - half.conj()).norm() < 1e-11,
                "{sigma} {height}"
            );
            assert!((inside.interior - half).norm() < 1e-11, "{sigma} {height}");
            assert_eq!(outside.interior, Complex64::ZERO);
            assert_eq!(inside.exterior, Complex64::ZERO);
        }
    }
}

#[test]
fn plate_is_two_half_spaces() {
    let plate = cuboid(
        DVec3::new(-20.0, -20.0, -0.5),
        DVec3::new(20.0, 20.0, 0.5),
        1,
    );
    for sigma in SIGMAS {
        let reference = ReferenceDensity::new(&plate, &kernel(sigma));
        for z in [0.0, 0.1, -0.2, 0.4] {
            // At depth z below a face at height xi h: the plane at distance h counts from u = h/xi.
            let xi: f64 = 0.5 - f64::abs(z);
            let plane = |h: f64| {
                let integrand = |u: f64| {
                    let (x, w) = ((u - 1.0) / sigma, 1.0 / (1.0 + u * u));
                    let e = (-0.5 * x * x).exp() * w * w / sigma;
                    Complex64::new(1.0 - u * u, 2.0 * u) * (e * h / xi)
                };
                let start = h / xi;
                common::simpson(start, start + 10.0 * sigma, 4000, integrand)
            };
            let expected = plane(0.5 - z) + plane(0.5 + z);
            let found = reference
                .unit_density(DVec3::new(0.1, 0.2, z), 1e-6)
                .interior;
            assert!(
                (found - expected).norm() < 1e-10,
                "{sigma} {z}: {found} {expected}"
            );
        }
    }
}

/// Density of the unit ball at distance `r` from its centre, by the 1-D integral over the polar
/// angle of the boundary point.
fn ball(r: f64, sigma: f64) -> Complex64 {
    let (xi, sign) = ((r - 1.0).abs(), (r - 1.0).signum());
    common::simpson(-1.0, 1.0, 20_000, |c| {
        // Boundary point at polar cosine c: (p - q).n = r c - 1.
        let eta = (1.0 + r * r - 2.0 * r * c).sqrt();
        let angle = 2.0 * std::f64::consts::PI * (r * c - 1.0) / eta.powi(3);
        common::kernel_h(eta / xi, sigma, sign, sign) * angle
    })
}

#[test]
fn sphere_converges_to_the_ball() {
    let meshes = [1, 2, 3].map(|level| icosphere(level, |p| p));
    let directions = random_points(12, 1.0, 5);
    for sigma in [0.1, 0.3] {
        let references = meshes
            .each_ref()
            .map(|m| ReferenceDensity::new(m, &kernel(sigma)));
        for r in [0.3, 0.6, 1.5, 2.5] {
            let exact = ball(r, sigma);
            let error = |reference: &ReferenceDensity| {
                let at = |d: &DVec3| (unit(reference, d.normalize() * r), exact);
                common::relative_l2(directions.iter().map(at))
            };
            let errors = references.each_ref().map(error);
            // Second order in the edge length: a quarter per level, with room for the directions.
            assert!(errors[1] < errors[0] / 2.0, "{sigma} {r} {errors:?}");
            assert!(errors[2] < errors[1] / 2.5, "{sigma} {r} {errors:?}");
            assert!(errors[2] < 0.05, "{sigma} {r} {errors:?}");
        }
    }
}

#[test]
fn random_polyhedra_by_subdivision() {
    for (seed, sigma) in SIGMAS.into_iter().enumerate() {
        let star = random_star(1, seed as u64);
        let reference = ReferenceDensity::new(&star, &kernel(sigma));
        let points = random_points(12, 1.3, seed as u64 + 100);
        let pairs = points.iter().map(|&p| {
            let xi = reference.signed_distance(p);
            (
                unit(&reference, p),
                subdivided_density(&star, p, xi, sigma, 0.04),
            )
        });
        let error = common::relative_l2(pairs);
        // The subdivided rule is second order in 0.04 kernel widths.
        assert!(error < 2e-4, "{sigma}: {error}");
    }
}

#[test]
fn boundary_values_are_means_of_both_sides() {
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    for sigma in SIGMAS {
        let reference = ReferenceDensity::new(&cube, &kernel(sigma));
        let half = kernel(sigma).half_space();
        let face = reference.unit_density(DVec3::new(0.4, 0.6, 1.0), 1e-5);
        // The limits are taken 1e-5 away.
        assert!((face.exterior - 0.5 * half.conj()).norm() < 1e-4);
        assert!((face.interior - 0.5 * half).norm() < 1e-4);
        for p in [
            DVec3::ONE,
            DVec3::ZERO,
            DVec3::new(1.0, 0.0, 0.3),
            DVec3::new(0.5, 0.5, 0.0),
        ] {
            let d = reference.unit_density(p, 1e-5);
            assert!(d.exterior.is_finite() && d.interior.is_finite());
            assert!(d.exterior.norm() > 0.0 && d.interior.norm() > 0.0, "{p}");
        }
    }
}
