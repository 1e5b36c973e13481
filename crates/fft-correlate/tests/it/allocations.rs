//! A rotation allocates nothing, a plan next to nothing, and a correlator what its plan says: counted
//! by the allocator itself.

use std::sync::Arc;

use crate::counting::{calls, held};
use fft_correlate::correlate::{CorrelatorPlan, HalfTurn, PairSupport};
use fft_correlate::{Correlator, Pair, ScoreModel, TranslationWindow};
use glam::{DQuat, DVec3};
use ndarray::Array3;
use num_complex::Complex32;
use sdf_grid::{DensityField, FIELD_VERSION, FieldProvenance, Lattice, Sampling};

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
        provenance: FieldProvenance {
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

fn pair(fixed: usize, moving: usize, model: ScoreModel) -> Pair {
    Pair::new(
        block(fixed, &model),
        block(moving, &model),
        model,
        DVec3::ZERO,
    )
    .unwrap()
}

#[test]
fn scores_and_gradients_allocate_nothing() {
    for model in [ScoreModel::GUIDED, ScoreModel::PAPER] {
        let pair = pair(20, 12, model);
        let window = TranslationWindow::cube(6.0, 1.0).unwrap();
        let plan = CorrelatorPlan::for_half_turns(&PairSupport::of(&pair).unwrap(), &window);
        let correlator = Correlator::build(&plan.unwrap(), &pair).unwrap();
        assert!(correlator.plan().shares_half_turns);
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

/// A window whose transforms are as large as they may be: 20 GiB that no one asks for.
#[test]
fn a_plan_of_the_largest_window_allocates_next_to_nothing() {
    let pair = pair(20, 12, ScoreModel::GUIDED);
    let (low, high) = (DVec3::splat(-512.0), DVec3::splat(511.0));
    let window = TranslationWindow::new(low, high, 1.0).unwrap();
    assert_eq!(window.shape(), [1024; 3]);
    let (support, _, most) = held(|| PairSupport::of(&pair).unwrap());
    assert!(most < 1 << 10, "{most}");
    for for_turns in [false, true] {
        let (plan, _, most) = held(|| match for_turns {
            false => CorrelatorPlan::new(&support, &window).unwrap(),
            true => CorrelatorPlan::for_half_turns(&support, &window).unwrap(),
        });
        assert!(most < 1 << 20, "{most}");
        assert!(plan.bytes(1) > 20 << 30 && plan.bytes(9) > plan.bytes(8));
        assert!(plan.to_string().contains("1024 x 1024 x 1024"), "{plan}");
    }
}

/// Within 5 %: tables of factors and of places are not counted.
#[test]
fn a_plan_says_what_its_correlator_takes() {
    let near = |held: u64, planned: u64| held >= planned && held <= planned + planned / 20;
    for model in [ScoreModel::GUIDED, ScoreModel::PAPER] {
        let pair = pair(60, 36, model);
        let window = TranslationWindow::cube(20.0, 1.0).unwrap();
        let support = PairSupport::of(&pair).unwrap();
        for plan in [
            CorrelatorPlan::new(&support, &window).unwrap(),
            CorrelatorPlan::for_half_turns(&support, &window).unwrap(),
        ] {
            let (correlator, shared, most) = held(|| Correlator::build(&plan, &pair).unwrap());
            assert_eq!(*correlator.plan(), plan);
            assert!(near(shared, plan.shared_bytes), "{shared}, {plan:?}");
            let building = plan.shared_bytes + plan.building_bytes;
            assert!(near(most, building), "{most}, {plan:?}");
            let (_scratch, scratch, _) = held(|| correlator.scratch());
            assert!(near(scratch, plan.scratch_bytes), "{scratch}, {plan:?}");
            let (double, shared, _) = held(|| Correlator::build_double(&plan, &pair).unwrap());
            let planned = double.plan().shared_bytes;
            assert!(near(shared, planned), "{shared}, {planned}");
            // Twice as wide, less what single precision pads its longer vectors with.
            assert!(planned > 3 * plan.shared_bytes / 2);
        }
    }
}
