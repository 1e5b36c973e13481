//! What must not change the energy of a pair: how its lattices lie in the parts, which part is
//! called fixed, and which of the two evaluations is asked. Each holds up to an error that shrinks
//! with the spacing.

use fft_correlate::{Pair, Pose, ScoreModel, TranslationWindow};
use glam::{DQuat, DVec3};
use pegfit_tests::{ask, displacement, example, full_direct, pair_of, rms, rotation, scores};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::shapes::PegInHole;

/// The spacings of the sweeps, metres: 7 and 13 cells across the peg.
const SPACINGS: [f64; 2] = [0.003, 0.0015];

/// Poses about the fit: up to 15 degrees and 5 mm from it.
fn poses(pair: &Pair) -> Vec<Pose> {
    let mut rng = SmallRng::seed_from_u64(3);
    (0..24)
        .map(|_| {
            let turn = rotation(&mut rng, 0.26);
            pair.pose(turn, displacement(&mut rng, 0.005))
        })
        .collect()
}

/// Root mean square of `a - b` in units of the fit's depth.
fn difference(pair: &Pair, a: &[f64], b: &[f64]) -> f64 {
    let fit = pair.pose(DQuat::IDENTITY, DVec3::ZERO);
    let depth = -ask(&full_direct(pair), &fit).energy;
    let off: Vec<_> = a.iter().zip(b).map(|(a, b)| (a - b) / depth).collect();
    rms(&off)
}

fn energies(pair: &Pair, poses: impl IntoIterator<Item = Pose>) -> Vec<f64> {
    let source = full_direct(pair);
    poses.into_iter().map(|p| ask(&source, &p).energy).collect()
}

/// FFT correlation and direct quadrature turn different lattices: the one resamples the moving
/// density on the fixed lattice, the other looks the moving cells up in the fixed density. Smoothed
/// densities do not mind; at the identity both are one sum but for the outermost rim of what smoothing
/// spreads, which the quadrature leaves out.
#[test]
fn correlation_and_quadrature_agree_on_the_examples() {
    let turns = [
        DQuat::IDENTITY,
        DQuat::from_rotation_z(0.4),
        DQuat::from_scaled_axis(DVec3::new(0.1, -0.15, 0.05)),
        DQuat::from_scaled_axis(DVec3::new(0.9, 0.5, -1.4)),
    ];
    for which in [PegInHole::Rectangular, PegInHole::Combined] {
        let errors = SPACINGS.map(|h| {
            let pair = example(which, &ScoreModel::GUIDED, h);
            let window = TranslationWindow::cube(0.006, h).expect("a window");
            turns.map(|turn| {
                let by_fft = scores(&pair, turn, &window);
                let by_fft: Vec<_> = by_fft.iter().map(|f| -f64::from(*f)).collect();
                let nodes = (0..by_fft.len()).map(|n| window.lattice().unravel(n));
                let places = nodes.map(|i| pair.pose(turn, window.displacement(i)));
                difference(&pair, &by_fft, &energies(&pair, places))
            })
        });
        println!("{which:?}: correlation against quadrature {errors:?}");
        assert!(
            errors.as_flattened().iter().all(|e| *e < 1e-3),
            "{errors:?}"
        );
    }
}

/// Both parts turned and moved together, so that no face lies along a lattice plane any more.
#[test]
fn moving_both_parts_together_changes_nothing() {
    let motion = Pose::new(
        DQuat::from_scaled_axis(DVec3::new(0.5, -0.3, 0.8)),
        DVec3::new(0.0123, -0.0047, 0.0081),
    );
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).expect("a pair");
    let errors = SPACINGS.map(|h| {
        let pair = pair_of(&hole, &peg, &ScoreModel::GUIDED, h);
        let moved =
            |mesh: &sdf_grid::TriangleMesh| mesh.transformed(motion.rotation, motion.translation);
        let turned = pair_of(&moved(&hole), &moved(&peg), &ScoreModel::GUIDED, h);
        let poses = poses(&pair);
        let there = poses.iter().map(|p| motion * *p * motion.inverse());
        let there = energies(&turned, there);
        difference(&pair, &energies(&pair, poses), &there)
    });
    println!("rigid motion of both parts {errors:?}");
    // What smoothing and the sum over samples leave falls with the spacing.
    assert!(errors[0] < 0.035 && errors[1] < 0.008, "{errors:?}");
}

/// The hole moved about the peg by the inverse pose.
#[test]
fn swapping_the_parts_at_the_inverse_pose_changes_nothing() {
    let (hole, peg) = PegInHole::Combined.pair(0.0).expect("a pair");
    let errors = SPACINGS.map(|h| {
        let pair = pair_of(&hole, &peg, &ScoreModel::GUIDED, h);
        let swapped = pair_of(&peg, &hole, &ScoreModel::GUIDED, h);
        let poses = poses(&pair);
        let back = energies(&swapped, poses.iter().map(Pose::inverse));
        difference(&pair, &energies(&pair, poses), &back)
    });
    println!("parts swapped: {errors:?}");
    // Only the fixed part's density is sharpened: what that leaves is of fourth order.
    assert!(errors.iter().all(|e| *e < 1e-3), "{errors:?}");
}
