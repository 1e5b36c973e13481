//! The paper's claims about the fit: the score is highest in the assembled pose, poses that a
//! symmetry takes to it score the same, and the three kinds of overlap have their signs.

use std::f64::consts::{FRAC_PI_2, PI};

use fft_correlate::{PairBuilder, ScoreModel, TranslationWindow, top_peaks};
use glam::{DQuat, DVec3};
use pegfit_tests::{ask, axis_rotations, example, full_direct, rotation, scores};
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::Silent;
use sdf_grid::shapes::{PegInHole, cuboid};

const H: f64 = 0.0025;

/// Index and value of the highest score.
fn highest(scores: &ndarray::Array3<f32>) -> ([usize; 3], f32) {
    let ((i, j, k), value) = scores
        .indexed_iter()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .expect("a window has nodes");
    ([i, j, k], *value)
}

/// Over 24 axis rotations and 12 random ones, and all translations to 20 mm, no pose scores higher
/// than the assembled one.
#[test]
fn the_score_is_highest_assembled_for_every_example_and_preset() {
    for model in [ScoreModel::PAPER, ScoreModel::GUIDED] {
        for which in PegInHole::ALL {
            let pair = example(which, &model, H);
            let window = TranslationWindow::cube(0.02, H).expect("a window");
            let assembled = scores(&pair, DQuat::IDENTITY, &window);
            let (index, best) = highest(&assembled);
            assert_eq!(
                window.displacement(index),
                DVec3::ZERO,
                "{which:?} {model:?}"
            );
            assert!(best > 0.0, "{which:?} {model:?}");
            let mut rng = SmallRng::seed_from_u64(1);
            let others = (0..12).map(|_| rotation(&mut rng, PI));
            let others: Vec<_> = axis_rotations().into_iter().chain(others).collect();
            let correlator = fft_correlate::Correlator::new(&pair, &window).expect("a plan");
            let (mut scratch, mut out) = (correlator.scratch(), assembled.clone());
            for q in others {
                correlator.score(q, &mut scratch, out.view_mut());
                let (index, other) = highest(&out);
                // Turns by right angles take the lattice to itself: equal fits agree to rounding.
                assert!(
                    other <= best * (1.0 + 1e-4),
                    "{which:?} {model:?}: {other} at {q}, {index:?} beats {best}"
                );
            }
        }
    }
}

/// Of the 24 axis rotations those fit that take the cross-section to itself: 8 for the square and
/// the circle, 2 for the combined section (it is symmetric about its key). All fits are as deep as
/// the assembled pose, and every other place is well above them.
#[test]
fn exactly_the_symmetric_fits_score_highest() {
    for (which, fits) in [
        (PegInHole::Circular, 8),
        (PegInHole::Rectangular, 8),
        (PegInHole::Combined, 2),
    ] {
        let pair = example(which, &ScoreModel::GUIDED, H);
        let window = TranslationWindow::cube(4.0 * H, H).expect("a window");
        let mut found = Vec::new();
        for q in axis_rotations() {
            let scores = scores(&pair, q, &window);
            found.extend(top_peaks(scores.view(), 4, 2.0).into_iter().map(|p| (q, p)));
        }
        found.sort_by(|a, b| b.1.score.total_cmp(&a.1.score));
        let depth = found[0].1.score;
        for (rank, (q, peak)) in found.iter().take(fits + 1).enumerate() {
            if rank < fits {
                // The circle's 96 corners, and what contact takes for them on this coarse lattice.
                assert!(peak.score > 0.998 * depth, "{which:?} {rank}: {q} {peak:?}");
                let displacement = window.displacement(peak.index).length();
                let along = (*q * DVec3::Z).z.abs();
                assert!(
                    displacement < 1e-9 && along > 0.999,
                    "{which:?} {rank}: {q} {peak:?}"
                );
            } else {
                assert!(peak.score < 0.93 * depth, "{which:?} {rank}: {q} {peak:?}");
            }
        }
    }
}

/// The square peg has the same energy in four poses 90 degrees apart, in the fit and beside it; the
/// round peg does not care about its spin at all.
#[test]
fn turns_that_a_section_does_not_notice_leave_the_energy_alone() {
    let beside = DVec3::new(0.0013, -0.0007, 0.003);
    let square = example(PegInHole::Rectangular, &ScoreModel::GUIDED, H);
    let source = full_direct(&square);
    let depth = -ask(&source, &square.pose(DQuat::IDENTITY, DVec3::ZERO)).energy;
    for place in [DVec3::ZERO, beside] {
        for tilt in [0.0, 0.1] {
            let tilt = DQuat::from_rotation_x(tilt);
            let energy = |k: u32| {
                let spin = DQuat::from_rotation_z(FRAC_PI_2 * f64::from(k));
                ask(&source, &square.pose(tilt * spin, place)).energy
            };
            for k in 1..4 {
                // The lattice turns with the peg; what is left is the mesh's diagonal on the
                // square faces, which the field's tolerance of 1e-3 bounds, and as much from the
                // samples of its surface, which lie otherwise on each face.
                let off = (energy(k) - energy(0)).abs();
                assert!(off < 2e-3 * depth, "{k} quarter turns: {off} of {depth}");
            }
        }
    }

    // A turned lattice meets a round wall differently; smoothed densities mind it little.
    let spread = [0.003, 0.0015].map(|h| {
        let round = example(PegInHole::Circular, &ScoreModel::GUIDED, h);
        let source = full_direct(&round);
        let energies = (0..24).map(|k| {
            let spin = DQuat::from_rotation_z(PI / 12.0 * f64::from(k));
            ask(&source, &round.pose(spin, DVec3::ZERO)).energy
        });
        let (low, high) = energies.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| {
            (a.min(e), b.max(e))
        });
        (high - low) / -low
    });
    println!("spread of the round peg's energy over spin: {spread:?}");
    // What contact gives falls with the spacing, and with it what its samples leave.
    assert!(
        spread[0] < 0.005 && spread[1] < 0.7 * spread[0],
        "{spread:?}"
    );
}

/// Overlap of two interiors costs (penalty), interior against exterior at a mating face pays
/// (reward), and exteriors that overlap, apart from contact, cost where they are counted
/// (separation weight 1) and do nothing where they are not.
#[test]
fn penalty_reward_and_separation_have_their_signs() {
    let cube = cuboid(DVec3::splat(0.02)).expect("a cube");
    let energy = |w: f64, offset: DVec3| {
        let model = ScoreModel {
            separation_weight: w,
            ..ScoreModel::PAPER
        };
        let builder = PairBuilder {
            spacing: Some(0.002),
            halo: Some(0.012),
            ..PairBuilder::default()
        };
        let pair = builder
            .build(&cube, &cube, &model, &Silent)
            .expect("a pair");
        let pose = pair.pose(DQuat::IDENTITY, offset);
        ask(&full_direct(&pair), &pose).energy
    };
    let (overlapping, touching, near, far) = (
        DVec3::new(0.006, 0.004, 0.0),
        DVec3::new(0.02, 0.0, 0.0),
        DVec3::new(0.028, 0.0, 0.0),
        DVec3::new(0.06, 0.0, 0.0),
    );
    let (penalty, reward) = (energy(0.0, overlapping), energy(0.0, touching));
    assert!(penalty > 0.0, "penalty {penalty}");
    assert!(reward < 0.0, "reward {reward}");
    let separation = energy(1.0, near) - energy(0.0, near);
    assert!(separation > 0.0, "separation {separation}");
    assert_eq!(energy(0.0, far), 0.0, "out of each other's reach");

    let peg = example(PegInHole::Rectangular, &ScoreModel::PAPER, H);
    let fit = ask(&full_direct(&peg), &peg.pose(DQuat::IDENTITY, DVec3::ZERO)).energy;
    let stuck = DVec3::new(0.004, 0.0, 0.0);
    let overlap = ask(&full_direct(&peg), &peg.pose(DQuat::IDENTITY, stuck)).energy;
    assert!(overlap > fit, "the wall pushes back: {fit} {overlap}");
}
