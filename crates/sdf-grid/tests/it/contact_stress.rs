//! The contact sum where it is hardest: whatever the parts and wherever they lie, it is finite.

use glam::{DQuat, DVec3};
use pegfit_fixtures::{self as shapes, PegInHole};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use sdf_grid::{ContactError, ContactSum, RepairOptions, TriangleMesh};

use crate::common::random_star;

/// Sizes about one: boxes, slivers, plates, pins, balls, rings, stars, solids of all kinds.
fn part(rng: &mut SmallRng) -> TriangleMesh {
    let seed = rng.random_range(0..1000);
    let mesh = match rng.random_range(0..8) {
        0 => shapes::cuboid(DVec3::new(1.0, 0.7, 0.4)),
        1 => shapes::cuboid(DVec3::new(1.0, 1e-5, 1e-3)),
        2 => shapes::plate(1.0, 1e-4),
        3 => shapes::cylinder(0.2, 1.0, rng.random_range(3..200)),
        4 => shapes::icosphere(0.5, rng.random_range(1..12)),
        5 => shapes::torus(0.4, 0.1, 40, 20),
        6 => Ok(random_star(2, seed)),
        _ => shapes::random_solid(seed),
    };
    mesh.expect("a shape")
}

/// Parts that fit into each other, are one another, or have nothing to do with each other; both
/// moved, scaled, and now and then far away from their origins.
fn pair(rng: &mut SmallRng) -> [TriangleMesh; 2] {
    let parts = match rng.random_range(0..5) {
        0 => {
            let which = PegInHole::ALL[rng.random_range(0..3)];
            let clearance = rng.random_range(0..4) as f64 * 1e-4;
            which.pair(clearance).expect("a pair").into()
        }
        1 => {
            let fit = shapes::random_fit(rng.random_range(0..200)).expect("a fit");
            [fit.fixed, fit.moving]
        }
        2 => {
            let same = part(rng);
            [same.clone(), same]
        }
        _ => [part(rng), part(rng)],
    };
    let scale = 10f64.powi(rng.random_range(-4..4));
    let far = if rng.random_bool(0.2) { 1e6 } else { 1.0 };
    parts.map(|p| {
        let size = p.bounds().size().max_element();
        let vertices = p.vertices().iter().map(|v| *v * (scale / size)).collect();
        let scaled = clean(vertices, p.triangles().to_vec());
        let turn = DQuat::from_scaled_axis(direction(rng) * rng.random_range(0.0..3.0));
        let place = scaled.bounds().center();
        scaled.transformed(turn, direction(rng) * (far * scale) - turn * place)
    })
}

fn clean(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    let options = RepairOptions {
        weld_tolerance: 0.0,
        max_open_fraction: 0.2,
    };
    let cleaned = TriangleMesh::clean("stress", vertices, triangles, &options);
    cleaned.expect("usable").0
}

fn direction(rng: &mut SmallRng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// Sums of a random pair at random poses: about each other, flush, and of any size.
fn queries(seed: u64, count: usize) -> usize {
    let mut rng = SmallRng::seed_from_u64(seed);
    let [a, b] = pair(&mut rng);
    let sizes = [&a, &b].map(|p| p.bounds().size().max_element());
    let size = sizes[0].max(sizes[1]);
    let width = size * 10f64.powf(rng.random_range(-1.0..0.5));
    let sum = match ContactSum::new(&a, &b, width, 1.25 * width) {
        Ok(sum) => sum,
        // Of what is much larger than the width there may be too much.
        Err(ContactError::TooMany { .. }) => return 0,
        Err(e) => panic!("{seed}: {e}"),
    };
    let [centre, pivot] = [&a, &b].map(|p| p.bounds().center());
    for k in 0..count {
        let turn = match k % 4 {
            0 => DQuat::IDENTITY,
            1 => DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
            _ => DQuat::from_scaled_axis(direction(&mut rng) * 4.0),
        };
        let away = match k % 5 {
            0 => DVec3::ZERO,
            1 => direction(&mut rng).signum() * 0.5 * (sizes[0] + sizes[1]),
            2 => direction(&mut rng) * 1e-9 * size,
            3 => direction(&mut rng) * width,
            _ => direction(&mut rng) * size,
        };
        let found = sum.sum(turn, centre + away - turn * pivot);
        let finite = found.gradient.is_finite() && found.moment.is_finite();
        assert!(finite && found.value.is_finite(), "{seed} {k}: {found:?}");
    }
    count
}

#[test]
fn sums_of_random_pairs_are_finite() {
    let found: usize = (0..16).into_par_iter().map(|s| queries(s, 300)).sum();
    assert!(found > 3000, "{found}");
}

#[test]
#[ignore = "ten million queries: about a quarter of an hour"]
fn ten_million_sums_of_random_pairs_are_finite() {
    let mut found = 0;
    for pairs in (0..1100u64).step_by(20) {
        let seeds = (pairs..pairs + 20).into_par_iter();
        found += seeds.map(|s| queries(s, 10_000)).sum::<usize>();
        println!("{found} sums");
    }
    assert!(found > 10_000_000, "{found}");
}
