use std::sync::Arc;

use ndarray::Array3;
use num_complex::{Complex32, Complex64};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{DensityField, Lattice};

use super::*;
use crate::correlate::fixtures::{H, fixed_part, moving_part, pair, window};
use crate::pair::model::ScoreModel;
use crate::vectors::levels;

/// The trilinear interpolant of a field in double precision, zero beyond the lattice.
fn interpolate(values: &Array3<Complex32>, at: DVec3) -> Complex64 {
    let mut sum = Complex64::default();
    for corner in 0..8 {
        let c = DVec3::new(
            (corner & 1) as f64,
            (corner >> 1 & 1) as f64,
            (corner >> 2) as f64,
        );
        let node = at.floor() + c;
        let weight = (1.0 - (at - node).abs()).to_array().iter().product::<f64>();
        if node.min_element() >= 0.0
            && let Some(v) = values.get(node.to_array().map(|v| v as usize))
        {
            sum += Complex64::new(v.re as f64, v.im as f64) * weight;
        }
    }
    sum
}

/// The score from its definition: the sum over all fixed nodes of the four weighted products.
fn direct(pair: &Pair, rotation: DQuat, displacement: DVec3) -> f64 {
    let m = pair.model();
    let (fixed, moving) = (pair.fixed(), pair.moving());
    let (l1, l2) = (m.lambda_exterior, m.lambda_interior);
    let back = pair.pose(rotation, displacement).inverse();
    let mut sum = 0.0;
    for ((i, j, k), o1) in fixed.exterior.indexed_iter() {
        let wide = |v: &Complex32| Complex64::new(v.re as f64, v.im as f64);
        let (o1, i1) = (wide(o1), wide(&fixed.interior[[i, j, k]]));
        let q = back.apply(fixed.lattice().position([i, j, k]));
        let q = moving.lattice().fractional_index(q);
        // Rounding must not push an exactly aligned node into the neighbouring cell.
        let q = (q * 1e9).round() / 1e9;
        let o2 = interpolate(&moving.exterior, q);
        let i2 = interpolate(&moving.interior, q);
        let f = o1 * o2 * (m.separation_weight * l1 * l1)
            + (o1 * i2 + i1 * o2) * (l1 * l2)
            + i1 * i2 * (l2 * l2);
        sum += f.re;
    }
    sum * H.powi(3)
}

fn score(pair: &Pair, rotation: DQuat, window: &TranslationWindow) -> Array3<f32> {
    let correlator = Correlator::new(pair, window).unwrap();
    let mut out = Array3::from_elem(window.shape(), f32::NAN);
    correlator.score(rotation, &mut correlator.scratch(), out.view_mut());
    out
}

/// Relative L2 distance.
fn distance<T: Real>(a: &Array3<T>, b: &Array3<f64>) -> f64 {
    let off = |a: &T, b: &f64| (Into::<f64>::into(*a) - b).powi(2);
    let wrong: f64 = a.iter().zip(b).map(|(a, b)| off(a, b)).sum();
    (wrong / b.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

fn random_rotation(rng: &mut SmallRng) -> DQuat {
    let mut q = || rng.random_range(-1.0..1.0);
    DQuat::from_xyzw(q(), q(), q(), q()).normalize()
}

/// f32 transforms (1e-7) of fields whose products cancel to about a tenth.
const TOLERANCE: f64 = 1e-5;

#[test]
fn equals_the_direct_sum_for_every_separation_weight() {
    let mut rng = SmallRng::seed_from_u64(1);
    let window = window();
    for w in [0.0, 0.3, 1.0] {
        for pivot in [DVec3::ZERO, DVec3::new(0.123, -0.04, 0.3)] {
            let pair = pair(w, pivot);
            for rotation in [
                DQuat::IDENTITY,
                random_rotation(&mut rng),
                random_rotation(&mut rng),
            ] {
                let found = score(&pair, rotation, &window);
                let (mut wrong, mut size) = (0.0, 0.0);
                for _ in 0..40 {
                    let n = window.shape().map(|s| rng.random_range(0..s));
                    let exact = direct(&pair, rotation, window.displacement(n));
                    wrong += (f64::from(found[n]) - exact).powi(2);
                    size += exact * exact;
                }
                let e = (wrong / size).sqrt();
                assert!(e < TOLERANCE, "w {w} pivot {pivot} {rotation}: {e}");
            }
        }
    }
}

/// Half turns at once against the same rotations one by one in double precision, on windows of even
/// and odd sizes, on one side, and one node wide, with the pivot at nodes and between them, with
/// one product and with two, for all vectors that there are. Which other turns are asked for must
/// not matter.
#[test]
fn half_turns_are_the_rotations_that_they_say() {
    let mut rng = SmallRng::seed_from_u64(7);
    let window = |lo: [i32; 3], hi: [i32; 3]| {
        let [lo, hi] = [lo, hi].map(|n| DVec3::from_array(n.map(f64::from)) * H);
        TranslationWindow::new(lo, hi, H).unwrap()
    };
    let windows = [
        window([-4, -2, -9], [2, 5, 3]),
        window([-20, -20, -20], [20, 20, 20]),
        window([-5, 0, -7], [6, 11, -7]),
        window([1, -2, 2], [7, 3, 10]),
    ];
    let mut shared = 0;
    for w in [0.0, 0.3, 1.0] {
        let pivots = [
            DVec3::ZERO,
            DVec3::new(0.05, 0.1, -0.15),
            DVec3::splat(0.123),
        ];
        for (pivot, window) in pivots
            .iter()
            .flat_map(|p| windows.iter().map(move |w| (p, w)))
        {
            let pair = pair(w, *pivot);
            let support = PairSupport::of(&pair).unwrap();
            let plan = CorrelatorPlan::for_half_turns(&support, window).unwrap();
            let at = |level| Correlator::<f32>::build_at(&plan, &pair, level).unwrap();
            let single: Vec<_> = levels().into_iter().map(at).collect();
            let double = Correlator::build_double(&plan, &pair).unwrap();
            let shares = plan.shares_half_turns;
            assert!(
                !shares || pivot.x != 0.123,
                "no node is the image of another"
            );
            shared += usize::from(shares);
            let rotation = random_rotation(&mut rng);
            let exact = HalfTurn::ALL.map(|turn| {
                let mut out = Array3::zeros(window.shape());
                let rotation = turn.rotation() * rotation;
                double.score(rotation, &mut double.scratch(), out.view_mut());
                out
            });
            let all = turned(&double, rotation, &HalfTurn::ALL, window);
            for (found, exact) in all.iter().zip(&exact) {
                let e = distance(found, exact);
                // Where nodes are sampled differs by rounding.
                assert!(e < 1e-11, "w {w} pivot {pivot} {:?}: {e}", window.shape());
            }
            for correlator in &single {
                let all = turned(correlator, rotation, &HalfTurn::ALL, window);
                for (found, exact) in all.iter().zip(&exact) {
                    let e = distance(found, exact);
                    assert!(
                        e < TOLERANCE,
                        "w {w} pivot {pivot} {:?}: {e}",
                        window.shape()
                    );
                }
                use HalfTurn::{None, X, Y, Z};
                for turns in [&[Z, X][..], &[Y, None], &[None], &[X, Y, Z]] {
                    let found = turned(correlator, rotation, turns, window);
                    for (found, turn) in found.iter().zip(turns) {
                        assert_eq!(*found, all[*turn as usize], "{turn:?} of {turns:?}");
                    }
                }
            }
        }
    }
    // Where longer transforms cost more than sharing saves there is none.
    assert!(shared > 18, "{shared} of 24 about a symmetric pivot");
}

/// Scores of a rotation followed by half turns.
fn turned<T: Real>(
    correlator: &Correlator<T>,
    rotation: DQuat,
    turns: &[HalfTurn],
    window: &TranslationWindow,
) -> Vec<Array3<T>> {
    let mut outs = vec![Array3::from_elem(window.shape(), T::nearest(f64::NAN)); turns.len()];
    let mut views: Vec<_> = outs.iter_mut().map(|out| out.view_mut()).collect();
    let scratch = &mut correlator.scratch();
    correlator.score_half_turns(rotation, turns, scratch, &mut views);
    outs
}

#[test]
fn scratch_carries_nothing_from_one_rotation_to_the_next() {
    let mut rng = SmallRng::seed_from_u64(2);
    let (pair, window) = (pair(0.0, DVec3::ZERO), window());
    let correlator = Correlator::new(&pair, &window).unwrap();
    let mut scratch = correlator.scratch();
    let mut score = |rotation| {
        let mut out = Array3::from_elem(window.shape(), f32::NAN);
        correlator.score(rotation, &mut scratch, out.view_mut());
        out
    };
    let rotations: Vec<_> = (0..4).map(|_| random_rotation(&mut rng)).collect();
    let first: Vec<_> = rotations.iter().map(|r| score(*r)).collect();
    for (rotation, before) in rotations.iter().zip(&first).rev() {
        assert_eq!(score(*rotation), before);
    }
}

/// A quarter turn about the pivot takes lattice nodes to lattice nodes: turning the array by hand
/// and scoring without rotation must give the same.
#[test]
fn quarter_turns_are_exact() {
    let window = window();
    for w in [0.0, 1.0] {
        let turned = pair(w, DVec3::ZERO);
        let quarter = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let found = score(&turned, quarter, &window);
        let mut moving = moving_part();
        // (x, y) -> (-y, x): the new first axis runs along the old y backwards.
        for values in [&mut moving.exterior, &mut moving.interior] {
            let mut by_hand = values.view().permuted_axes([1, 0, 2]);
            by_hand.invert_axis(ndarray::Axis(0));
            *values = by_hand.as_standard_layout().into_owned();
        }
        let (old, shape) = (moving.lattice().node_bounds(), moving.lattice().shape());
        let origin = DVec3::new(-old.max.y, old.min.x, old.min.z);
        moving.provenance.lattice =
            Lattice::new(origin, H, [shape[1], shape[0], shape[2]]).unwrap();
        let by_hand = Pair::new(
            Arc::new(fixed_part()),
            Arc::new(moving),
            *turned.model(),
            DVec3::ZERO,
        );
        let expected = score(&by_hand.unwrap(), DQuat::IDENTITY, &window);
        let e = distance(&found, &expected.mapv(f64::from));
        assert!(e < 1e-6, "w {w}: {e}");
    }
}

#[test]
fn swapping_the_parts_and_inverting_the_pose_keeps_the_score() {
    let window = TranslationWindow::cube(0.4, H).unwrap();
    for w in [0.0, 0.3, 1.0] {
        let pair = pair(w, DVec3::ZERO);
        let swapped = Pair::new(
            Arc::new(moving_part()),
            Arc::new(fixed_part()),
            *pair.model(),
            DVec3::ZERO,
        )
        .unwrap();
        for rotation in [
            DQuat::IDENTITY,
            DQuat::from_rotation_x(std::f64::consts::PI / 2.0),
        ] {
            let found = score(&pair, rotation, &window);
            let back = score(&swapped, rotation.conjugate(), &window);
            let expected = Array3::from_shape_fn(window.shape(), |(i, j, k)| {
                let t = pair
                    .pose(rotation, window.displacement([i, j, k]))
                    .inverse()
                    .translation;
                let at = window.lattice().fractional_index(t).round().to_array();
                f64::from(back[at.map(|v| v as usize)])
            });
            let e = distance(&found, &expected);
            assert!(e < TOLERANCE, "w {w} {rotation}: {e}");
        }
    }
}

#[test]
fn moving_both_parts_together_changes_nothing() {
    let shift = DVec3::new(3.0, -7.0, 20.0) * H;
    let pivot = DVec3::new(0.02, 0.03, -0.1);
    let rotation = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.4));
    let pair = pair(0.3, pivot);
    let shifted = |mut field: DensityField| {
        let lattice = *field.lattice();
        field.provenance.lattice =
            Lattice::new(lattice.origin() + shift, H, lattice.shape()).unwrap();
        Arc::new(field)
    };
    let moved = Pair::new(
        shifted(fixed_part()),
        shifted(moving_part()),
        *pair.model(),
        pivot + shift,
    )
    .unwrap();
    let expected = score(&pair, rotation, &window()).mapv(f64::from);
    assert!(distance(&score(&moved, rotation, &window()), &expected) < 1e-6);
}

/// With w = 0 the score is `l1 l2 X + l2^2 Y`.
#[test]
fn the_score_is_quadratic_in_the_weights() {
    let window = window();
    let rotation = DQuat::from_scaled_axis(DVec3::new(0.5, 0.1, -0.2));
    let with = |lambda_exterior, lambda_interior| {
        let model = ScoreModel {
            lambda_exterior,
            lambda_interior,
            ..ScoreModel::GUIDED
        };
        let parts = (Arc::new(fixed_part()), Arc::new(moving_part()));
        let pair = Pair::new(parts.0, parts.1, model, DVec3::ZERO).unwrap();
        score(&pair, rotation, &window).mapv(f64::from)
    };
    let (a, b) = (with(1.0, 1.0), with(2.0, 1.0));
    let (x, y) = (&b - &a, 2.0 * &a - &b);
    let e = distance(&with(0.7, 3.0).mapv(|v| v as f32), &(2.1 * &x + 9.0 * &y));
    assert!(e < TOLERANCE, "{e}");
}

/// The definition in double precision, and the same code in f32 and f64.
#[test]
fn double_precision_is_exact_and_single_is_good_to_rounding() {
    let rotation = DQuat::from_scaled_axis(DVec3::new(0.5, 0.1, -0.2));
    let window = window();
    for w in [0.0, 1.0] {
        let pair = pair(w, DVec3::new(0.123, -0.04, 0.3));
        let plan = CorrelatorPlan::new(&PairSupport::of(&pair).unwrap(), &window).unwrap();
        let correlator = Correlator::build_double(&plan, &pair).unwrap();
        let mut exact = Array3::from_elem(window.shape(), f64::NAN);
        correlator.score(rotation, &mut correlator.scratch(), exact.view_mut());
        let e = distance(&score(&pair, rotation, &window), &exact);
        assert!(e < 1e-6, "w {w}: {e}");
        let (mut wrong, mut size) = (0.0, 0.0);
        for n in [[0, 0, 0], [2, 1, 5], [6, 7, 12], [3, 5, 8]] {
            let truth = direct(&pair, rotation, window.displacement(n));
            wrong += (exact[n] - truth).powi(2);
            size += truth * truth;
        }
        // The oracle rounds coordinates to 1e-9 cells, across which values differ by ten times the
        // part of the products that does not cancel.
        assert!(
            (wrong / size).sqrt() < 1e-7,
            "w {w}: {}",
            (wrong / size).sqrt()
        );
    }
}

/// Against central differences of the definition. A step of 1e-4 cells passes a kink of the
/// interpolant at about that share of the nodes.
#[test]
fn gradients_equal_differences_of_the_definition() {
    let mut rng = SmallRng::seed_from_u64(7);
    let window = window();
    for w in [0.0, 1.0] {
        let pair = pair(w, DVec3::new(0.123, -0.04, 0.3));
        let rotation = random_rotation(&mut rng);
        let correlator = Correlator::new(&pair, &window).unwrap();
        let mut found: [Array3<f32>; 6] = std::array::from_fn(|_| Array3::zeros(window.shape()));
        let views = found.each_mut().map(|a| a.view_mut());
        correlator.gradient(rotation, &mut correlator.scratch(), views);
        let (mut wrong, mut size) = ([0.0; 2], [0.0; 2]);
        for _ in 0..12 {
            let n = window.shape().map(|s| rng.random_range(0..s));
            let d = window.displacement(n);
            for (c, found) in found.iter().enumerate() {
                let step = DVec3::AXES[c % 3] * if c < 3 { 1e-4 } else { 1e-4 * H };
                let at = |sign: f64| {
                    if c < 3 {
                        let turn = DQuat::from_scaled_axis(sign * step);
                        direct(&pair, turn * rotation, d)
                    } else {
                        direct(&pair, rotation, d + sign * step)
                    }
                };
                let exact = (at(1.0) - at(-1.0)) / (2.0 * step.length());
                wrong[c / 3] += (f64::from(found[n]) - exact).powi(2);
                size[c / 3] += exact * exact;
            }
        }
        for part in 0..2 {
            let e: f64 = (wrong[part] / size[part]).sqrt();
            assert!(e < 2e-3, "w {w}, part {part}: {e}");
        }
    }
}

#[test]
fn parts_that_never_meet_score_zero() {
    let far = TranslationWindow::new(DVec3::splat(5.0), DVec3::splat(5.3), H).unwrap();
    let zero = score(&pair(0.0, DVec3::ZERO), DQuat::IDENTITY, &far);
    assert!(zero.iter().all(|v| *v == 0.0));
}

#[test]
#[should_panic(expected = "scratch of another correlator")]
fn scratch_of_another_correlator_is_refused() {
    let (near, pair) = (window(), pair(0.0, DVec3::ZERO));
    let wide = TranslationWindow::cube(0.9, H).unwrap();
    let mut scratch = Correlator::new(&pair, &wide).unwrap().scratch();
    let mut out = Array3::zeros(near.shape());
    let correlator = Correlator::new(&pair, &near).unwrap();
    correlator.score(DQuat::IDENTITY, &mut scratch, out.view_mut());
}
