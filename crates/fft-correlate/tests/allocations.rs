//! A rotation allocates nothing: counted by the allocator itself.

mod counting;

use std::sync::Arc;

use counting::calls;
use fft_correlate::{Correlator, HalfTurn, Pair, ScoreModel, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::Array3;
use num_complex::Complex32;
use sdf_grid::{DensityField, FIELD_VERSION, FieldRecipe, Lattice, Sampling};

/// A block, solid inside and with a rim of exterior around.
fn block(nodes: usize, model: &ScoreModel) -> Arc<DensityField> {
    let lattice = Lattice::new(DVec3::splat(0.5 - nodes as f64 / 2.0), 1.0, [nodes; 3]);
    let rim = |i: usize| i < 3 || i + 3 >= nodes;
    let values = |inside: bool| {
        Array3::from_shape_fn([nodes; 3], |(i, j, k)| {
            if (rim(i) || rim(j) || rim(k)) != inside {
                Complex32::new(0.3, 0.1 * k as f32 - 1.0)
            } else {
                Complex32::default()
            }
        })
    };
    Arc::new(DensityField {
        exterior: values(false),
        interior: values(true),
        signed_distance: Array3::zeros([nodes; 3]),
        recipe: FieldRecipe {
            version: FIELD_VERSION,
            mesh: String::new(),
            sigma: model.sigma,
            halo: 3.0,
            tolerance: 1e-3,
            sampling: Sampling::Point,
            lattice: lattice.expect("a small lattice"),
        },
    })
}

#[test]
fn scores_and_gradients_allocate_nothing() {
    for model in [ScoreModel::GUIDED, ScoreModel::PAPER] {
        let (fixed, moving) = (block(20, &model), block(12, &model));
        let pair = Pair::new(fixed, moving, model, DVec3::ZERO).unwrap();
        let window = TranslationWindow::cube(6.0, 1.0).unwrap();
        let correlator = Correlator::plan_half_turns(&pair, &window).unwrap();
        assert!(correlator.description().shares_half_turns);
        let mut scratch = correlator.scratch();
        let mut out = Array3::zeros(window.shape());
        let mut parts: [Array3<f32>; 6] = std::array::from_fn(|_| Array3::zeros(window.shape()));
        let mut work = |turn: f64| {
            let rotation = DQuat::from_rotation_y(turn);
            correlator.score(rotation, &mut scratch, out.view_mut());
            let views = parts.each_mut().map(|a| a.view_mut());
            correlator.gradient(rotation, &mut scratch, views);
            let [a, b, c, d, ..] = &mut parts;
            let outs = &mut [a, b, c, d].map(|a| a.view_mut());
            correlator.score_half_turns(rotation, &HalfTurn::ALL, &mut scratch, outs);
        };
        // What the standard library sets up on first use.
        work(0.1);
        let before = calls();
        assert!(before > 0, "the counter counts");
        for turn in [0.0, 0.7, -2.0] {
            work(turn);
        }
        assert_eq!(calls(), before);
    }
}
