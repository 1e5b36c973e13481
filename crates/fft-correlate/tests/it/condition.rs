//! Condition numbers of scores: against the direct evaluator and a brute-force sum, and where they
//! are known.

use crate::direct_support::{Blobs, brute_force, model, pair, random_pose};
use fft_correlate::{
    Condition, DirectEvaluator, DirectOptions, Pair, PairBuilder, Pose, ScoreModel,
};
use glam::DVec3;
use num_complex::Complex32;
use rand::{SeedableRng, rngs::SmallRng};
use sdf_grid::Silent;
use sdf_grid::shapes::PegInHole;

fn direct(pair: &Pair) -> DirectEvaluator {
    DirectEvaluator::new(pair, &DirectOptions::FULL).expect("valid pair")
}

fn round_peg(model: &ScoreModel) -> Pair {
    let (hole, peg) = PegInHole::Circular.pair(0.0).expect("example");
    let builder = PairBuilder {
        spacing: Some(0.003),
        ..PairBuilder::default()
    };
    builder
        .build(&hole, &peg, model, &Silent)
        .expect("buildable")
}

/// Single precision rounds each term of the evaluator to about 1e-7: its score is within 1e-5 of the
/// magnitude, however far the terms cancel. The f64 sum differs in the order of summation alone.
#[test]
fn score_is_that_of_the_evaluators() {
    for w in [0.0, 0.25, 0.9, 1.0] {
        let pair = pair(&Blobs::new(1), &Blobs::new(2), 0.001, model(w));
        let direct = direct(&pair);
        let mut rng = SmallRng::seed_from_u64(3);
        for _ in 0..6 {
            let pose = random_pose(&mut rng, 0.012);
            let condition = Condition::at(&pair, &pose);
            let (fast, slow) = (direct.score(&pose).re, brute_force(&pair, &pose).re);
            let bound = condition.magnitude;
            assert!((condition.score - fast).abs() <= 1e-5 * bound, "w = {w}");
            assert!((condition.score - slow).abs() <= 1e-12 * bound, "w = {w}");
            assert!(condition.magnitude >= condition.score.abs());
        }
    }
}

/// In the hole the interiors' rewards and the penalties of a shallow overlap cancel; the sum of
/// absolute terms is then well above the score, and it never depends on the sign of a term.
#[test]
fn overlap_cancels() {
    let pair = round_peg(&ScoreModel::GUIDED);
    let at = |x: f64| Condition::at(&pair, &Pose::from_translation(DVec3::X * x));
    let numbers = [0.0, 0.003, 0.006, 0.009].map(|x| at(x).number());
    assert!(
        numbers[0] < 1.5 && numbers.iter().any(|n| *n > 3.0),
        "{numbers:?}"
    );
}

/// Apart, an interior meets nothing but the other part's exterior: every term is a reward.
#[test]
fn nothing_cancels_where_parts_are_apart() {
    let pair = round_peg(&ScoreModel::GUIDED);
    let condition = Condition::at(&pair, &Pose::from_translation(DVec3::Z * 0.035));
    assert!(condition.score > 0.0);
    // Sharpening overshoots next to the surfaces.
    assert!(condition.number() < 1.5, "{condition:?}");
}

/// Two cells whose terms are known: 3 · 5 and -3 · 5 · (1 - 2^-20), four nodes apart.
#[test]
fn six_orders_of_cancellation_are_seen() {
    let mut fixed = Blobs::new(1).field(0.001, 0.012);
    let mut moving = Blobs::new(1).field(0.001, 0.012);
    for field in [&mut fixed, &mut moving] {
        field.exterior.fill(Complex32::ZERO);
        field.interior.fill(Complex32::ZERO);
    }
    let near_minus_one = -1.0 + (-20f32).exp2();
    fixed.interior[[8, 8, 8]] = Complex32::new(3.0, 0.0);
    fixed.interior[[12, 8, 8]] = Complex32::new(3.0, 0.0);
    moving.interior[[8, 8, 8]] = Complex32::new(5.0, 0.0);
    moving.interior[[12, 8, 8]] = Complex32::new(5.0 * near_minus_one, 0.0);
    let model = ScoreModel::GUIDED;
    let (fixed, moving) = (fixed.into(), moving.into());
    let model = ScoreModel {
        sigma: 0.1,
        ..model
    };
    let pair = Pair::new(fixed, moving, model, DVec3::ZERO).expect("matching fields");
    let condition = Condition::at(&pair, &Pose::IDENTITY);
    let unit = 25.0 * 15.0 * 1e-9;
    let left = unit * (-20f64).exp2();
    assert!(
        (condition.score - left).abs() < 1e-9 * left,
        "{condition:?}"
    );
    let number = 2f64 * 20f64.exp2();
    assert!((condition.number() / number - 1.0).abs() < 1e-5);
    // Single precision is right to its rounding of the terms, not of the sum.
    let fast = direct(&pair).score(&Pose::IDENTITY).re;
    assert!((fast - left).abs() <= 2e-7 * condition.magnitude);
}

#[test]
fn nothing_at_all_has_condition_one() {
    let pair = pair(&Blobs::new(1), &Blobs::new(2), 0.002, model(1.0));
    let far = Condition::at(&pair, &Pose::from_translation(DVec3::X));
    assert_eq!(far, Condition::default());
    assert_eq!(far.number(), 1.0);
}
