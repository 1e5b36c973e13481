//! What a table says outside its window and its rotations: what it says at the edge, fading.

use crate::common::*;
use crate::table::{gradient_error, is_gradient};
use fft_correlate::{EnergyTable, Pose, Response, RotationDomain, Side, TableSpec};
use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

/// Half the window of all tables here, no unit.
const HALF: f64 = 0.3;

fn with_symmetry(mut spec: TableSpec, part: Side, order: u32) -> TableSpec {
    spec.symmetry = Some(symmetry(part, order));
    spec
}

fn specs() -> Vec<TableSpec> {
    let of = |rotations| spec(window(HALF, 0.1), rotations);
    let spin = RotationDomain::Spin {
        center: [0.0, 0.0, 0.0, 1.0],
        axis: [0.2, 0.1, 1.0],
        range_deg: Some([-50.0, 70.0]),
        step_deg: 10.0,
    };
    vec![
        of(RotationDomain::ball(40.0, 8.0)),
        with_symmetry(of(RotationDomain::ball(30.0, 8.0)), Side::Moving, 3),
        with_symmetry(of(RotationDomain::ball(30.0, 8.0)), Side::Fixed, 0),
        of(spin),
        of(RotationDomain::single(DQuat::from_rotation_y(0.3))),
    ]
}

fn tables() -> Vec<EnergyTable> {
    let of = |spec: TableSpec| {
        let energy = match &spec.symmetry {
            Some(symmetry) => Gaussians::symmetric(31, symmetry),
            None => Gaussians::random(31),
        };
        table(&energy, spec)
    };
    specs().into_iter().map(of).collect()
}

#[test]
fn the_wrench_outside_is_the_energys_gradient() {
    for table in tables() {
        let reach = HALF + 1.1 * table.spec().fade_length();
        let error = gradient_error(&table, 1500, |rng| {
            let turn = vector(rng).normalize() * rng.random_range(0.0..3.1);
            pose(DQuat::from_scaled_axis(turn), vector(rng) * reach)
        });
        assert!(
            is_gradient(error),
            "{:?}: {error:?}",
            table.spec().rotations
        );
    }
}

/// Poses on the way straight out of the window, by what is left of the fade, 0 at the edge.
fn way_out(rng: &mut SmallRng, table: &EnergyTable) -> impl Fn(f64) -> Response {
    let axis = rng.random_range(0..3);
    let side = if rng.random() { 1.0 } else { -1.0 };
    let mut at = vector(rng) * HALF;
    at[axis] = 0.0;
    let turn = rotation_within(rng, 0.3);
    let length = table.spec().fade_length();
    let mut out = DVec3::ZERO;
    out[axis] = side;
    move |share: f64| table.respond(&pose(turn, at + out * (HALF + share * length)))
}

/// A fade over `L` of an energy `E` adds `1.5 E / L` at most; without it the force would be that of
/// the edge, whose slope outwards comes to rest within two nodes.
#[test]
fn no_wall_stands_at_the_edge_of_a_window() {
    let mut rng = SmallRng::seed_from_u64(32);
    for table in tables() {
        let length = table.spec().fade_length();
        let inside: Vec<Response> = (0..4000)
            .map(|_| {
                table.respond(&pose(
                    rotation_within(&mut rng, 0.3),
                    vector(&mut rng) * HALF,
                ))
            })
            .collect();
        let most = |of: &dyn Fn(&Response) -> f64| inside.iter().map(of).fold(0.0, f64::max);
        let force = most(&|r| r.wrench.force.length());
        let energy = most(&|r| r.energy.abs());
        let bound = 1.05 * force + 1.5 * 1.1 * energy / length;
        for _ in 0..300 {
            let at = way_out(&mut rng, &table);
            for k in 0..=60 {
                let found = at(f64::from(k) / 60.0).wrench.force.length();
                assert!(
                    found <= bound,
                    "{:?}: {found}, at most {bound}",
                    table.spec().rotations
                );
            }
            // A symmetry turns what leaves one way into what leaves another.
            if table.spec().symmetry.is_some() {
                continue;
            }
            assert!(at(0.98).energy != 0.0);
            let gone = at(1.001);
            assert_eq!((gone.energy, gone.coverage), (0.0, 0.0));
            assert_eq!(gone.wrench.force, DVec3::ZERO);
        }
    }
}

/// Two nodes outside nothing of the edge's own slope outwards is left, and most of its energy is.
#[test]
fn coverage_ends_before_the_energy_has_faded() {
    let table = &tables()[0];
    let at = |x: f64| table.respond(&pose(DQuat::IDENTITY, DVec3::new(x, 0.05, -0.1)));
    let (edge, outside) = (at(HALF), at(HALF + 0.201));
    assert!(edge.coverage == 1.0 && outside.coverage == 0.0);
    assert!(outside.energy.abs() > 0.5 * edge.energy.abs());
    let turned = |angle: f64| {
        let pose: Pose = pose(DQuat::from_rotation_z(angle), DVec3::new(0.05, 0.0, 0.1));
        table.respond(&pose)
    };
    let (edge, outside) = (turned(40f64.to_radians()), turned(57f64.to_radians()));
    assert!(edge.coverage == 1.0 && outside.coverage == 0.0);
    assert!(outside.energy.abs() > 0.5 * edge.energy.abs());
}
