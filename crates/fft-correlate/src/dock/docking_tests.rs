use std::sync::Arc;

use glam::{DQuat, DVec3};
use pegfit_fixtures::{self as shapes, PegInHole};
use sdf_grid::{Silent, TriangleMesh};

use super::*;
use crate::direct::evaluator::{DirectEvaluator, DirectOptions};

/// Nothing may begin.
struct Nothing;

impl Monitor for Nothing {
    fn begin(&self, stage: &str, _: u64) {
        panic!("{stage} began");
    }

    fn cancelled(&self) -> bool {
        false
    }
}

#[test]
fn a_correlation_beyond_the_limit_is_refused_before_any_field_is_computed() {
    // One thread's scores need less than the fields.
    let threads = rayon::ThreadPoolBuilder::new().num_threads(4).build();
    threads.unwrap().install(refused_for_its_scores);
}

fn refused_for_its_scores() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let mut setup = PairSetup::new(Arc::new(hole), Arc::new(peg));
    let by_energy = DockingRequest {
        ranking: Ranking::Energy,
        ..DockingRequest::default()
    };
    let plan = Docking::new(&setup, by_energy.clone()).plan().unwrap();
    let needed = plan.scoring_bytes(rayon::current_num_threads());
    let said = plan.to_string();
    assert!(
        said.contains("coarse: ") && said.contains("rotations x"),
        "{said}"
    );
    // Enough for each pair's fields.
    let limit = needed - 1;
    assert!(plan.pairs.iter().all(|p| p.bytes <= limit), "{said}");
    setup.builder.memory_limit = Some(limit);
    let refused = Docking::new(&setup, by_energy).run(&Nothing);
    match refused {
        Err(DockingError::Memory {
            needed: n,
            limit: l,
        }) => assert_eq!((n, l), (needed, limit)),
        other => panic!("{other:?}"),
    }
}

/// A generated peg and its hole, each moved, docked: how far the first pose is from the assembled
/// one (metres, radians, up to the peg's symmetry), and the report.
fn docked(seed: u64, [fixed, moving]: [Pose; 2], ranking: Ranking) -> (f64, f64, DockingResult) {
    let fit = shapes::random_fit(seed).unwrap();
    let put =
        |part: &TriangleMesh, at: Pose| Arc::new(part.transformed(at.rotation, at.translation));
    let setup = PairSetup::new(put(&fit.fixed, fixed), put(&fit.moving, moving));
    let request = DockingRequest {
        ranking,
        ..DockingRequest::default()
    };
    let report = Docking::new(&setup, request).run(&Silent).unwrap();
    let (pose, pivot) = (report.poses[0].found.pose, report.lattices.pivot);
    let miss = |symmetry: &Pose| {
        let seat = fixed * moving.inverse() * *symmetry;
        let away = seat.apply(pivot).distance(pose.apply(pivot));
        (away, seat.angle_to(&pose))
    };
    let misses = report.symmetries.iter().map(miss);
    let (away, angle) = misses.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    (away, angle, report)
}

/// Docking keeps its exteriors short; what it says of an energy is what the pair itself says.
#[test]
fn the_energy_of_a_pose_is_that_of_the_setups_own_pair() {
    let fit = shapes::random_fit(8).unwrap();
    let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.4));
    let fixed = Arc::new(fit.fixed.transformed(turn, DVec3::new(0.01, 0.0, -0.02)));
    let setup = PairSetup::new(fixed, Arc::new(fit.moving));
    for ranking in [Ranking::Contact, Ranking::Energy] {
        let options = DockingRequest {
            top: 2,
            ranking,
            ..DockingRequest::default()
        };
        let report = Docking::new(&setup, options).run(&Silent).unwrap();
        let own = setup.load(&Silent).unwrap();
        let source = DirectEvaluator::new(&own, &DirectOptions::FULL).unwrap();
        for pose in &report.poses {
            let energy = source.evaluate_full(&pose.found.pose).response.energy;
            let error = (pose.model_energy - energy).abs() / energy.abs();
            // Two lattices, and a scale of energy found on each.
            assert!(error < 0.1, "{energy} J, not {} J", pose.model_energy);
        }
    }
}

fn turned(x: f64, y: f64, z: f64) -> Pose {
    let rotation = DQuat::from_scaled_axis(DVec3::new(x, y, z));
    Pose::new(rotation, 0.01 * DVec3::new(y, z, x))
}

fn require_fit(seed: u64, motions: [Pose; 2], ranking: Ranking) {
    let (away, angle, report) = docked(seed, motions, ranking);
    // What counts as the same pose to somebody who looks at it.
    assert!(
        away < 5e-4 && angle < 0.035,
        "{seed}, {ranking:?}: {away} m, {angle} rad"
    );
    // More than any other way to lie against the hole.
    let areas = report.poses.iter().map(|p| p.mating_area);
    let widest = areas.fold(0.0, f64::max);
    assert_eq!(
        report.poses[0].mating_area, widest,
        "{seed}, {ranking:?}: {:?}",
        report.poses
    );
    let ranks: Vec<f64> = report.poses.iter().map(|p| p.rank).collect();
    let ordered = match ranking {
        Ranking::Contact => ranks.is_sorted_by(|a, b| a >= b),
        Ranking::Energy => (report.poses).is_sorted_by_key(|p| p.found.energy),
    };
    assert!(ordered, "{seed}, {ranking:?}: {:?}", report.poses);
}

/// Both parts turned by themselves: a stepped peg, whose fit cell averages score below many poses
/// that lean.
#[test]
fn a_fit_is_found_wherever_both_parts_lie() {
    let motions = [turned(0.7, -1.2, 0.5), turned(-1.9, 0.4, 1.1)];
    require_fit(3, motions, Ranking::Contact);
    require_fit(3, motions, Ranking::Energy);
}

/// The same peg turned so that wide cells score most rotations above those next to the fit; both
/// parts shifted by fractions of a cell: a rectangular peg in thin walls.
#[test]
#[ignore = "a minute; run by `just long`"]
fn fits_are_found_in_other_frames() {
    let shift = Pose::from_translation(DVec3::new(3.1e-4, -1.7e-4, 4.3e-4));
    for ranking in [Ranking::Contact, Ranking::Energy] {
        require_fit(3, [Pose::IDENTITY, turned(-0.47, 0.567, 0.139)], ranking);
        require_fit(8, [shift, shift], ranking);
    }
}

#[test]
fn a_mating_clearance_below_zero_is_refused() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let setup = PairSetup::new(Arc::new(hole), Arc::new(peg));
    for found in [-1e-3, f64::NAN, f64::INFINITY] {
        let options = DockingRequest {
            mating_clearance: Some(found),
            ..DockingRequest::default()
        };
        let refused = Docking::new(&setup, options).run(&Nothing);
        assert!(
            matches!(refused, Err(DockingError::MatingClearance { .. })),
            "{refused:?}"
        );
    }
}
