use std::sync::Arc;

use glam::DVec3;
use sdf_grid::Silent;

use super::*;
use crate::correlate::correlator::Correlator;
use crate::correlate::fixtures::{H, fixed_part, moving_part, pair, window};
use crate::pair::builder::PairBuilder;
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;

#[test]
fn plans_say_what_is_transformed_and_what_is_skipped() {
    let plan = |w, window: &TranslationWindow| {
        let support = PairSupport::of(&pair(w, DVec3::ZERO)).unwrap();
        CorrelatorPlan::new(&support, window).unwrap()
    };
    let near = window();
    let transforms =
        |p: &CorrelatorPlan| (p.products.len(), p.forward_transforms, p.inverse_transforms);
    assert_eq!(transforms(&plan(0.0, &near)), (2, 4, 1));
    assert_eq!(transforms(&plan(0.5, &near)), (2, 4, 1));
    assert_eq!(transforms(&plan(1.0, &near)), (1, 2, 1));
    let guided = plan(0.0, &near);
    assert_eq!(guided.window, near.shape());
    for product in &guided.products {
        for axis in 0..3 {
            let nodes = product.moving_nodes[axis].max(guided.window[axis]);
            assert!(guided.transform_size[axis] >= nodes, "{guided:?}");
        }
    }
    let far = TranslationWindow::new(DVec3::splat(5.0), DVec3::splat(5.3), H).unwrap();
    let none = plan(0.0, &far);
    assert_eq!((transforms(&none), none.skipped.len()), ((0, 0, 0), 2));
    assert_eq!((none.shared_bytes, none.scratch_bytes), (0, 0));
}

#[test]
fn bad_input_is_refused() {
    let pair = pair(0.0, DVec3::ZERO);
    let support = PairSupport::of(&pair).unwrap();
    let other = TranslationWindow::cube(0.5, 0.11).unwrap();
    let refused = CorrelatorPlan::new(&support, &other).err();
    assert_eq!(
        refused,
        Some(CorrelateError::Spacing {
            expected: H,
            found: 0.11
        })
    );
    let huge = TranslationWindow::cube(100.0, H).unwrap();
    let refused = CorrelatorPlan::new(&support, &huge).err();
    assert!(
        matches!(refused, Some(CorrelateError::Size { .. })),
        "{refused:?}"
    );
    let mut moving = moving_part();
    moving.interior[[1, 2, 3]].im = f32::NAN;
    let pair = Pair::new(
        Arc::new(fixed_part()),
        Arc::new(moving),
        *pair.model(),
        DVec3::ZERO,
    );
    let refused = PairSupport::of(&pair.unwrap()).err();
    let expected = CorrelateError::NotFinite {
        part: "moving",
        index: [1, 2, 3],
    };
    assert_eq!(refused, Some(expected));
}

/// A plan belongs to its pair's weights and to where its densities are nonzero.
#[test]
fn another_pair_is_refused() {
    let (planned, window) = (pair(0.0, DVec3::ZERO), window());
    let plan = CorrelatorPlan::new(&PairSupport::of(&planned).unwrap(), &window).unwrap();
    assert_eq!(*Correlator::build(&plan, &planned).unwrap().plan(), plan);
    let mut moving = moving_part();
    moving.interior[[0, 0, 0]].re = 1.0;
    let more = (Arc::new(fixed_part()), Arc::new(moving));
    let more = Pair::new(more.0, more.1, *planned.model(), DVec3::ZERO).unwrap();
    for other in [pair(0.3, DVec3::ZERO), pair(0.0, DVec3::X), more] {
        let refused = Correlator::build(&plan, &other).err();
        assert_eq!(refused, Some(CorrelateError::OtherPair));
    }
}

/// What is planned before the densities are known is enough for what they turn out to need, and at
/// most twice that.
#[test]
fn plans_from_the_parts_bound_those_of_their_densities() {
    let box_of = |size: [f64; 3]| sdf_grid::shapes::cuboid(DVec3::from_array(size)).unwrap();
    let mut parts = sdf_grid::shapes::PegInHole::ALL
        .map(|shape| shape.pair(0.0).unwrap())
        .to_vec();
    parts.push((box_of([0.2, 0.15, 0.1]), box_of([0.02, 0.03, 0.15])));
    for (fixed, moving) in parts {
        let smoothed = Some(0.7);
        for (separation_weight, smoothing) in
            [(0.0, smoothed), (0.0, None), (0.5, smoothed), (1.0, None)]
        {
            let model = ScoreModel {
                separation_weight,
                ..ScoreModel::GUIDED
            };
            let longest = moving.bounds().size().max_element();
            let builder = PairBuilder {
                spacing: Some(longest / 16.0),
                halo: Some(longest / 4.0),
                smoothing,
                ..PairBuilder::default()
            };
            let planned = builder.plan(&fixed, &moving, &model).unwrap();
            let pair = planned.build(&fixed, &moving, None, &Silent).unwrap();
            let bound = PairSupport::planned(&planned, &fixed, &moving);
            let found = PairSupport::of(&pair).unwrap();
            let reach = DVec3::splat(0.5 * longest);
            let window = TranslationWindow::new(-reach, reach, pair.spacing()).unwrap();
            for make in [CorrelatorPlan::new, CorrelatorPlan::for_half_turns] {
                for threads in [1, 8] {
                    let [needed, planned] =
                        [&found, &bound].map(|s| make(s, &window).unwrap().bytes(threads));
                    let most = CorrelatorPlan::largest(&bound, &window, threads).unwrap();
                    assert!(
                        needed <= most.bytes(threads) && planned <= 2 * needed,
                        "{separation_weight} {smoothing:?}: {needed}, planned {planned}"
                    );
                }
            }
        }
    }
}

#[test]
fn sizes_are_known_large_enough_and_no_worse_than_their_neighbours() {
    for min in (1..300).step_by(7) {
        let min = [min, 2 * min / 3 + 1, min / 2 + 1];
        let window = min.map(|n| n / 2 + 1);
        let moving = [window];
        let size = best_size(min, window, &moving);
        let cost = seconds(size, window, &moving, 1).expect("a size of known factors");
        for axis in 0..3 {
            assert!(size[axis] >= min[axis], "{min:?} -> {size:?}");
            let mut longer = size;
            longer[axis] = 2 * size[axis];
            assert!(seconds(longer, window, &moving, 1).is_none_or(|c| c > cost));
        }
    }
    let half = [64; 3];
    assert_eq!(best_size([127; 3], half, &[half]), [128; 3]);
}

#[test]
fn more_work_costs_more() {
    let cost = |moving: usize, window: usize, terms: usize| {
        seconds([128; 3], [window; 3], &vec![[moving; 3]; terms], 1).unwrap()
    };
    assert!(cost(64, 64, 1) < cost(96, 64, 1));
    assert!(cost(64, 64, 1) < cost(64, 96, 1));
    assert!(cost(64, 64, 1) < cost(64, 64, 2));
    assert!(
        seconds([7, 8, 8], [1; 3], &[], 1).is_none() && seconds([8; 3], [1; 3], &[], 1).is_some()
    );
}
