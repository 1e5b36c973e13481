//! Docking by contact finds where parts of machines belong, and their joints, however they lie.

use std::f64::consts::TAU;
use std::sync::Arc;

use fft_correlate::{Docking, DockingPose, DockingRequest, PairSetup, Pose};
use glam::{DQuat, DVec2, DVec3};
use pegfit_fixtures::{JointPair, RightPlaces, joint, joint_names};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::shapes::prism;
use sdf_grid::{Silent, TriangleMesh};

/// An axis this near the stated one is it: radians (0.5 degrees), metres.
const SAME_AXIS: (f64, f64) = (8.727e-3, 2e-4);

/// A turn about any axis and a shift of some centimetres.
fn random_motion(rng: &mut SmallRng) -> Pose {
    let mut cube = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
    let (axis, shift) = (cube(), 0.05 * cube());
    let turn = rng.random_range(0.0..TAU);
    Pose::new(DQuat::from_axis_angle(axis.normalize(), turn), shift)
}

/// Where the pair's axis is beside the first pose found, from where it is as the pair lies; none if
/// neither that pose nor those alike are right.
fn way(pair: &JointPair, [fixed, moving]: [Pose; 2], first: &DockingPose) -> Option<Pose> {
    let right = RightPlaces::new(&pair.moving, &pair.right);
    let mut all = std::iter::once(&first.found.pose).chain(&first.alike);
    all.find_map(|pose| {
        let own = fixed.inverse() * *pose * moving;
        let (turn, shift) = right.places()[right.find((own.rotation, own.translation))?];
        Some(first.found.pose * pose.inverse() * fixed * Pose::new(turn, shift))
    })
}

fn wrong(pair: &JointPair, seed: u64) -> Option<String> {
    let mut rng = SmallRng::seed_from_u64(seed);
    let motions = [random_motion(&mut rng), random_motion(&mut rng)];
    let put = |part: &TriangleMesh, at: Pose| part.transformed(at.rotation, at.translation);
    let parts = [put(&pair.fixed, motions[0]), put(&pair.moving, motions[1])];
    let [fixed, moving] = parts.map(Arc::new);
    let mut setup = PairSetup::new(fixed, moving);
    // No energies: they take most of the time, and contact alone ranks.
    setup.builder.memory_limit = Some(1);
    let report = Docking::new(&setup, DockingRequest::default())
        .run(&Silent)
        .unwrap();
    assert!(report.no_energies.is_some() && report.energy_search.is_none());
    let first = &report.poses[0];
    let Some(to) = way(pair, motions, first) else {
        return Some(format!("not right: {first:?}"));
    };
    let (stated, found) = (pair.joint?, &first.joint);
    if found.kind.name() != stated.name() {
        return Some(format!("{stated:?}, not {found:?}"));
    }
    let axis = stated.axis().map(|axis| to.rotation * axis);
    let angle = axis.map_or(0.0, |axis| axis.cross(found.axis).length().asin());
    let across = stated.point().map_or(0.0, |point| {
        let away = to.apply(point) - found.point;
        axis.map_or(away, |axis| away.reject_from(axis)).length()
    });
    (angle > SAME_AXIS.0 || across > SAME_AXIS.1)
        .then(|| format!("axis off by {angle} rad, {across} m: {found:?}"))
}

/// Docks joints of the fixtures, each moved by motions that a seed draws.
fn require_places_and_joints(names: &[&str]) {
    let mut failures = Vec::new();
    for (seed, name) in (0..).zip(names) {
        let began = std::time::Instant::now();
        let index = joint_names().position(|n| n == *name).unwrap();
        let failure = wrong(&joint(1, index).unwrap(), seed);
        println!("{name}: {:.1} s", began.elapsed().as_secs_f64());
        failures.extend(failure.map(|what| format!("{name}: {what}")));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn parts_of_machines_find_their_places_and_joints_however_they_lie() {
    require_places_and_joints(&[
        "key-round-ends",
        "hexagon-bar-through",
        "bearing-in-housing",
        "pin-blind-one-of-four",
        "ball-in-cup",
    ]);
}

/// The lattice of a whole plate would have one cell across the pin: there are no energies then.
#[test]
fn a_pin_is_docked_in_a_plate_a_thousand_times_as_wide() {
    let hole = DVec3::new(0.31, -0.22, 0.0);
    let square = |half: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|c| half * DVec2::from_array(c))
    };
    let window: Vec<DVec2> = square(0.51e-3)
        .iter()
        .rev()
        .map(|p| *p + hole.truncate())
        .collect();
    let plate = prism(&square(0.5), &[window], 0.002).unwrap();
    let pin = prism(&square(0.5e-3), &[], 0.004).unwrap();
    let setup = PairSetup::new(Arc::new(plate), Arc::new(pin));
    let report = Docking::new(&setup, DockingRequest::default())
        .run(&Silent)
        .unwrap();
    let first = &report.poses[0];
    let off = (first.found.pose.translation - hole).truncate().length();
    assert!(off < 5e-5, "{first:?}");
    assert_eq!(first.joint.kind.name(), "prismatic");
}

#[test]
#[ignore = "minutes; run by `just long`"]
fn more_parts_of_machines_find_their_places_and_joints() {
    require_places_and_joints(&[
        "tray-flush-lid",
        "bricks-2x2-on-2x4",
        "spline-6",
        "dovetail-open",
        "connector-1x4-lock",
        "bracket-three-pins",
        "nut-left-hand",
    ]);
}
