//! Queries of tables wherever they may fall, and specifications that are refused.

use std::f64::consts::PI;

use crate::common::*;
use fft_correlate::{EnergyTable, Pose, RotationDomain, RotationError, Side, TableError};
use glam::{DQuat, DVec3};
use rand::SeedableRng;
use rand::rngs::SmallRng;
use sdf_grid::Silent;

#[test]
fn opposite_quaternions_are_one_pose() {
    let energy = Gaussians::random(10);
    let mut symmetric = spec(window(0.3, 0.15), RotationDomain::full(30.0));
    symmetric.symmetry = Some(symmetry(Side::Moving, 3));
    let specs = [
        spec(window(0.3, 0.15), RotationDomain::ball(60.0, 15.0)),
        spec(window(0.3, 0.15), RotationDomain::full(30.0)),
        symmetric,
    ];
    let mut rng = SmallRng::seed_from_u64(11);
    for spec in specs {
        let table = table(&energy, spec);
        for _ in 0..2000 {
            let p = pose(rotation(&mut rng), vector(&mut rng) * 0.4);
            let opposite = Pose {
                rotation: -p.rotation,
                ..p
            };
            assert_eq!(table.respond(&p), table.respond(&opposite));
        }
    }
}

#[test]
fn every_query_is_finite_and_far_ones_are_uncovered() {
    let energy = Gaussians::random(12);
    let thin = sdf_grid::Lattice::new(DVec3::new(-0.1, 0.0, 0.2), 0.1, [2, 1, 3]).unwrap();
    let mut with_symmetry = spec(window(0.3, 0.15), RotationDomain::full(30.0));
    with_symmetry.symmetry = Some(symmetry(Side::Fixed, 0));
    let specs = [
        spec(thin, RotationDomain::ball(30.0, 10.0)),
        spec(window(0.3, 0.15), RotationDomain::ball(120.0, 25.0)),
        with_symmetry,
        spec(thin, RotationDomain::single(DQuat::from_rotation_y(0.3))),
    ];
    let mut rng = SmallRng::seed_from_u64(13);
    for mut spec in specs {
        spec.far_energy = -0.7;
        let table = table(&energy, spec);
        for n in 0..25_000 {
            let reach = 10f64.powi(n % 9 - 4);
            let r = table.respond(&pose(rotation(&mut rng), vector(&mut rng) * reach));
            assert!(r.energy.is_finite() && r.wrench.is_finite());
            assert!((-1e-12..=1.0 + 1e-12).contains(&r.coverage));
        }
        for bad in [f64::NAN, f64::INFINITY, 1e300, -1e308] {
            let r = table.respond(&Pose::from_translation(DVec3::new(0.0, bad, 0.0)));
            assert_eq!((r.energy, r.coverage), (-0.7, 0.0));
            assert_eq!(r.wrench, fft_correlate::Wrench::ZERO);
        }
        let skewed = Pose {
            rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0),
            translation: DVec3::ZERO,
        };
        assert_eq!(table.respond(&skewed).coverage, 0.0);
    }
}

#[test]
fn batches_equal_single_queries() {
    let energy = Gaussians::random(15);
    let table = table(
        &energy,
        spec(window(0.3, 0.15), RotationDomain::ball(30.0, 10.0)),
    );
    let mut rng = SmallRng::seed_from_u64(16);
    let poses: Vec<_> = (0..1000)
        .map(|_| pose(rotation_within(&mut rng, 0.6), vector(&mut rng) * 0.5))
        .collect();
    let mut responses = vec![Default::default(); poses.len()];
    table.respond_many(&poses, &mut responses);
    for (pose, response) in poses.iter().zip(&responses) {
        assert_eq!(*response, table.respond(pose));
    }
}

#[test]
fn bad_specifications_are_refused() {
    let energy = Gaussians::random(17);
    let try_spec = |change: &dyn Fn(&mut fft_correlate::TableSpec)| {
        let mut s = spec(window(0.3, 0.15), RotationDomain::ball(30.0, 10.0));
        change(&mut s);
        let w = s.window;
        EnergyTable::compute(s, &OnWindow(&energy, w), 1 << 20, &Silent)
    };
    let range = |e| matches!(e, Err(TableError::Rotations(RotationError::Range { .. })));
    assert!(range(try_spec(
        &|s| s.rotations = RotationDomain::ball(30.0, 0.0)
    )));
    assert!(range(try_spec(
        &|s| s.rotations = RotationDomain::ball(f64::NAN, 5.0)
    )));
    assert!(range(try_spec(
        &|s| s.rotations = RotationDomain::ball(200.0, 5.0)
    )));
    assert!(range(try_spec(&|s| {
        s.symmetry = Some(symmetry(Side::Moving, 65));
    })));
    assert!(matches!(
        try_spec(&|s| s.rotations = RotationDomain::full(1e-4)),
        Err(TableError::Rotations(RotationError::Size { .. }))
    ));
    assert!(matches!(
        try_spec(&|s| s.rotations = RotationDomain::full(5.0)),
        Err(TableError::Memory { .. })
    ));
    assert!(matches!(
        try_spec(&|s| {
            s.rotations = RotationDomain::single(DQuat::IDENTITY);
            s.symmetry = Some(symmetry(Side::Moving, 4));
        }),
        Err(TableError::Rotations(RotationError::Symmetry { order: 4 }))
    ));
    assert!(matches!(
        try_spec(&|s| s.provenance.pivot[1] = f64::INFINITY),
        Err(TableError::Spec { name: "pivot", .. })
    ));
}

/// Ten million poses near, beyond and far from the domains of tables of every kind; about a minute.
#[test]
#[ignore = "long; run by `just stress-tables`"]
fn ten_million_queries_are_finite() {
    let energy = Gaussians::random(18);
    let thin = sdf_grid::Lattice::new(DVec3::new(-0.1, 0.0, 0.2), 0.1, [2, 1, 3]).unwrap();
    let mut folded = spec(window(0.3, 0.1), RotationDomain::full(30.0));
    folded.symmetry = Some(symmetry(Side::Fixed, 4));
    // With how many queries at least must have coverage: of all rotations a ball of 30 degrees, and
    // a step of 10 around it, holds 1.8 %, and the thin window lies to one side of most positions.
    let specs = [
        (spec(thin, RotationDomain::ball(30.0, 10.0)), 5_000),
        (
            spec(window(0.3, 0.1), RotationDomain::ball(120.0, 25.0)),
            100_000,
        ),
        (spec(window(0.3, 0.1), RotationDomain::full(30.0)), 100_000),
        (folded, 100_000),
    ];
    for (spec, least) in specs {
        let table = table(&energy, spec);
        let mut rng = SmallRng::seed_from_u64(19);
        let mut responses = vec![Default::default(); 100_000];
        let mut covered = 0;
        for _ in 0..25 {
            let poses: Vec<_> = (0..100_000)
                .map(|n| {
                    let reach = 10f64.powi(n % 9 - 4);
                    let q = match n % 3 {
                        // Half turns lie on the charts' far ends.
                        0 => DQuat::from_scaled_axis(PI * vector(&mut rng).normalize()),
                        _ => rotation(&mut rng),
                    };
                    pose(q, vector(&mut rng) * reach)
                })
                .collect();
            table.respond_many(&poses, &mut responses);
            for r in &responses {
                assert!(r.energy.is_finite() && r.wrench.is_finite() && r.coverage.is_finite());
                covered += usize::from(r.coverage > 0.0);
            }
        }
        println!("2500000 queries finite, {covered} of them with coverage");
        assert!(covered > least);
    }
}

/// Half turns about any axis are the same pose from either side.
#[test]
fn half_turns_have_no_seam() {
    let energy = Gaussians::random(20);
    let table = table(&energy, spec(window(0.3, 0.15), RotationDomain::full(30.0)));
    let mut rng = SmallRng::seed_from_u64(21);
    for n in 0..2000 {
        let axis = match n % 4 {
            0 => [DVec3::X, DVec3::Y, DVec3::Z][n / 4 % 3],
            _ => vector(&mut rng).normalize(),
        };
        let d = vector(&mut rng) * 0.3;
        let at = |angle: f64| table.respond(&pose(DQuat::from_axis_angle(axis, angle), d));
        let (a, b) = (at(PI - 1e-12), at(PI + 1e-12));
        // Energies and wrenches are of order one to ten; single-precision sums.
        assert!((a.energy - b.energy).abs() < 2e-6, "{a:?} {b:?}");
        let change = a.wrench - b.wrench;
        assert!(change.force.length().max(change.torque.length()) < 2e-5);
    }
}
