//! The two independent evaluations of a score against each other: FFT correlation and direct
//! quadrature.

use crate::direct_support::{Blobs, model, pair};
use fft_correlate::{Correlator, DirectEvaluator, DirectOptions, Pair, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::Array3;

/// Relative L2 difference of the two over a window of translations.
fn difference(pair: &Pair, rotation: DQuat) -> f64 {
    let window = TranslationWindow::cube(0.002, pair.spacing()).expect("a small window");
    let correlator = Correlator::new(pair, &window).expect("a valid pair");
    let mut scores = Array3::<f32>::zeros(window.shape());
    correlator.score(rotation, &mut correlator.scratch(), scores.view_mut());
    let direct = DirectEvaluator::new(pair, &DirectOptions::FULL).expect("a valid pair");
    let (mut error, mut size) = (0.0, 0.0);
    for ((i, j, k), &fast) in scores.indexed_iter() {
        let pose = pair.pose(rotation, window.displacement([i, j, k]));
        let expected = direct.score(&pose).re;
        error += (f64::from(fast) - expected).powi(2);
        size += expected.powi(2);
    }
    f64::sqrt(error / size)
}

/// Without rotation every lookup is at a node, so both are the same sum: single precision is left.
#[test]
fn they_agree_at_lattice_translations() {
    for w in [0.0, 0.5, 1.0] {
        let pair = pair(&Blobs::new(31), &Blobs::new(32), 0.001, model(w));
        let found = difference(&pair, DQuat::IDENTITY);
        assert!(found < 1e-5, "w = {w}: {found}");
    }
}

/// Turned lattices do not meet in nodes. The correlator resamples the moving density, the direct
/// evaluator interpolates in the other part's: they differ in second order of the spacing.
#[test]
fn they_converge_under_rotation() {
    let turns = [
        DQuat::from_rotation_z(0.3),
        DQuat::from_scaled_axis(DVec3::new(0.5, -0.8, 1.1)),
    ];
    for (w, rotation) in [0.0, 1.0].into_iter().zip(turns) {
        {
            let [coarse, fine] = [0.001, 0.0005].map(|h| {
                difference(
                    &pair(&Blobs::new(33), &Blobs::new(34), h, model(w)),
                    rotation,
                )
            });
            assert!(coarse < 0.05, "w = {w}: {coarse}");
            assert!(fine < 0.35 * coarse, "w = {w}: {coarse} -> {fine}");
        }
    }
}
