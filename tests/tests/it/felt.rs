//! Two meshes in, a felt force out: the simulated hand lets go of the peg near the hole and the
//! energy seats it; against the walls it cannot push it out.

use std::sync::atomic::AtomicBool;

use fft_correlate::peak_force;
use fft_correlate::{DirectEvaluator, DirectOptions, ScoreModel};
use glam::{DQuat, DVec3};
use haptic::{Clock, HapticConfig, OperatorConfig, Outcome, Script, Session, SimulatedOperator};
use pegfit_tests::{example, hand_at_fit};
use sdf_grid::shapes::PegInHole;

/// Largest force of the scene, newtons.
const PEAK: f64 = 4.0;

fn run(which: PegInHole, script: Script, seconds: f64) -> Outcome {
    let pair = example(which, &ScoreModel::GUIDED, 0.0025);
    let seated = pair.pose(DQuat::IDENTITY, DVec3::ZERO);
    let options = DirectOptions {
        max_points: Some(4_000),
        ..DirectOptions::REAL_TIME
    };
    let plain = DirectEvaluator::new(&pair, &options).expect("a source");
    let (peak, _) = peak_force(&plain, &seated, DVec3::splat(0.015));
    let pair = pair.with_gamma(PEAK / peak).expect("a scale");
    let source = DirectEvaluator::new(&pair, &options).expect("a source");
    let (geometry, workspace) = hand_at_fit(&pair);
    let hand = OperatorConfig {
        duration: seconds,
        ..OperatorConfig::default()
    };
    Session::new(HapticConfig::default(), workspace)
        .keep_samples()
        .run(
            &mut SimulatedOperator::new(hand, script, geometry, workspace),
            &source,
            Clock::Simulated,
            seconds,
            &AtomicBool::new(false),
        )
        .expect("a run")
}

/// The hand wanders about the entrance, brings the peg near and lets go: the peg seats within a
/// tenth of a millimetre sideways and half a cell along, although it strayed by centimetres.
#[test]
fn the_snap_test_ends_seated() {
    for which in [PegInHole::Circular, PegInHole::Combined] {
        let outcome = run(which, Script::Snap, 4.0);
        let strayed = outcome
            .samples
            .iter()
            .map(|s| s.object.translation.length())
            .fold(0.0, f64::max);
        assert!(strayed > 0.01, "{which:?} strayed {strayed}");
        let end = outcome.last.object;
        println!("{which:?} ends at {:?}", end.translation);
        assert!(
            end.translation.with_z(0.0).length() < 2e-4,
            "{which:?} {end:?}"
        );
        assert!(end.translation.z.abs() < 1.25e-3, "{which:?} {end:?}");
        let tilt = (end.rotation * DVec3::Z).angle_between(DVec3::Z);
        assert!(tilt < 0.01, "{which:?} tilted by {tilt}");
    }
}

/// Pushes of 3 N against walls of 4 N are felt and do not drive the peg out of its hole sideways.
#[test]
fn the_collision_test_pushes_back() {
    let outcome = run(PegInHole::Rectangular, Script::Collision, 4.0);
    assert!(
        outcome.report.peak_force > 1.0,
        "{}",
        outcome.report.peak_force
    );
    assert!(outcome.report.peak_force < 1.2 * PEAK);
    let sideways = outcome
        .samples
        .iter()
        .map(|s| s.object.translation.with_z(0.0).length())
        .fold(0.0, f64::max);
    // The rounding of contact over two cells is what it can give way by.
    assert!(sideways < 2.0 * 0.0025, "{sideways}");
}
