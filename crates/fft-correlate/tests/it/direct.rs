//! The direct evaluator against an f64 brute-force sum, closed forms and invariants.

use crate::direct_support::{
    Blobs, brute_force, central_differences, closed_form, model, pair, random_pose,
};
use fft_correlate::testing::score_terms;
use fft_correlate::{DirectError, DirectEvaluator, DirectOptions, EnergySource, Pose, Twist};
use glam::{DQuat, DVec3};
use rand::{SeedableRng, rngs::SmallRng};

const WEIGHTS: [f64; 4] = [0.0, 0.25, 0.9, 1.0];

/// The products of the plan add up to the four terms of the score, whatever the weight.
#[test]
fn plan_covers_every_term_once() {
    for w in WEIGHTS {
        let pair = pair(&Blobs::new(1), &Blobs::new(2), 0.002, model(w));
        let m = pair.model();
        let terms = score_terms(&pair);
        let total =
            |f: &dyn Fn(&fft_correlate::testing::Term) -> f64| terms.iter().map(f).sum::<f64>();
        // A term is symmetric in points and lookup but for which part is which.
        let part = |t: &fft_correlate::testing::Term| match t.points {
            fft_correlate::Side::Fixed => (t.weights, t.lookup),
            fft_correlate::Side::Moving => (t.lookup, t.weights),
        };
        let (l1, l2) = (m.lambda_exterior, m.lambda_interior);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "w = {w}: {a} is not {b}");
        near(
            total(&|t| part(t).0.exterior * part(t).1.exterior),
            w * l1 * l1,
        );
        near(total(&|t| part(t).0.exterior * part(t).1.interior), l1 * l2);
        near(total(&|t| part(t).0.interior * part(t).1.exterior), l1 * l2);
        near(total(&|t| part(t).0.interior * part(t).1.interior), l2 * l2);
    }
}

/// Single precision rounds about 1e-7 of each of some 10^4 terms; 1e-5 of the largest score leaves
/// room for poses where terms cancel.
#[test]
fn full_score_is_the_brute_force_sum() {
    for w in WEIGHTS {
        let pair = pair(&Blobs::new(3), &Blobs::new(4), 0.001, model(w));
        let direct = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
        let scale = brute_force(&pair, &Pose::IDENTITY).norm();
        let mut rng = SmallRng::seed_from_u64(5);
        for _ in 0..8 {
            let pose = random_pose(&mut rng, 0.012);
            let (fast, slow) = (direct.score(&pose), brute_force(&pair, &pose));
            assert!(
                (fast - slow).norm() < 1e-5 * scale,
                "w = {w}: {fast} is not {slow}"
            );
            let full = direct.evaluate_full(&pose);
            let response = direct.evaluate(&pose, &mut direct.scratch());
            let energy = -pair.model().gamma * fast.re;
            assert!((response.energy - energy).abs() <= 1e-6 * energy.abs());
            assert_eq!(full.score, fast);
            assert_eq!(full.response, response);
        }
    }
}

/// Trilinear lookups and midpoint cells are second order in the spacing for smooth densities.
#[test]
fn score_converges_to_the_closed_form() {
    let (fixed, moving) = (Blobs::new(6), Blobs::new(7));
    for w in [0.0, 0.5, 1.0] {
        let mut rng = SmallRng::seed_from_u64(8);
        let poses: Vec<_> = (0..6).map(|_| random_pose(&mut rng, 0.004)).collect();
        let errors = [0.001, 0.0005].map(|spacing| {
            let pair = pair(&fixed, &moving, spacing, model(w));
            let direct = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
            let (mut error, mut size) = (0.0, 0.0);
            for pose in &poses {
                let exact = closed_form(&fixed, &moving, pair.model(), pose);
                error += (direct.score(pose) - exact).norm_sqr();
                size += exact.norm_sqr();
            }
            f64::sqrt(error / size)
        });
        assert!(errors[0] < 0.05, "w = {w}: {errors:?}");
        assert!(errors[1] < 0.35 * errors[0], "w = {w}: {errors:?}");
    }
}

/// Steps of 1e-5 spacings: almost no point crosses a cell face, where the gradient jumps.
#[test]
fn wrench_is_minus_the_energy_gradient() {
    for w in WEIGHTS {
        let pair = pair(&Blobs::new(9), &Blobs::new(10), 0.001, model(w));
        let direct = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
        let energy = |pose: &Pose| -pair.model().gamma * brute_force(&pair, pose).re;
        let mut rng = SmallRng::seed_from_u64(11);
        for _ in 0..3 {
            let pose = random_pose(&mut rng, 0.004);
            let expected = central_differences(energy, &pose, 1e-8, 1e-6);
            let found = direct.evaluate(&pose, &mut direct.scratch()).wrench;
            let off = found - expected;
            assert!(
                off.force.length() < 1e-4 * expected.force.length()
                    && off.torque.length() < 1e-4 * expected.torque.length(),
                "w = {w}: {found:?} is not {expected:?}"
            );
        }
    }
}

/// The midpoint rule's work around a closed loop of large turns against the largest work between
/// two corners. The energy is a function of the pose, so only the rule's own error remains:
/// each of some 10^5 crossings of a cell face, where the gradient jumps, adds a random bit in
/// proportion to the step (0.45 % at 400 steps, 0.1 % at 1600).
#[test]
fn work_around_a_closed_loop_vanishes() {
    let pair = pair(&Blobs::new(12), &Blobs::new(13), 0.001, model(0.0));
    let direct = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
    let mut rng = SmallRng::seed_from_u64(14);
    let corners: Vec<_> = (0..4).map(|_| random_pose(&mut rng, 0.004)).collect();
    let mut scratch = direct.scratch();
    let (mut work, mut largest) = (0.0, 0.0f64);
    for (a, b) in (0..4).map(|i| (corners[i], corners[(i + 1) % 4])) {
        let whole = a.twist_to(&b);
        const STEPS: usize = 400;
        for s in 0..STEPS {
            let at = |f: f64| {
                a.perturbed(&Twist {
                    angular: f / STEPS as f64 * whole.angular,
                    linear: f / STEPS as f64 * whole.linear,
                })
            };
            let (from, to) = (at(s as f64), at(s as f64 + 1.0));
            let wrench = direct.evaluate(&at(s as f64 + 0.5), &mut scratch).wrench;
            work += wrench.dot(&from.twist_to(&to));
        }
        let rise =
            direct.evaluate(&a, &mut scratch).energy - direct.evaluate(&b, &mut scratch).energy;
        largest = largest.max(rise.abs());
    }
    assert!(work.abs() < 1e-2 * largest, "work {work} against {largest}");
}

/// A quaternion and its negative are the same rotation, to the last bit.
#[test]
fn quaternion_sign_does_not_matter() {
    let pair = pair(&Blobs::new(15), &Blobs::new(16), 0.001, model(0.0));
    let direct = DirectEvaluator::new(&pair, &DirectOptions::REAL_TIME).expect("valid pair");
    let mut rng = SmallRng::seed_from_u64(17);
    for _ in 0..4 {
        let pose = random_pose(&mut rng, 0.004);
        let negated = Pose {
            rotation: -pose.rotation,
            ..pose
        };
        assert_eq!(direct.evaluate_full(&pose), direct.evaluate_full(&negated));
    }
}

/// Swapping the parts and inverting the pose exchanges points and lookups: equal up to the
/// second-order error of the lookups, well under 1 % here, and falling with the spacing.
#[test]
fn swapped_parts_at_the_inverse_pose_score_the_same() {
    let (a, b) = (Blobs::new(18), Blobs::new(19));
    for w in WEIGHTS {
        let errors = [0.001, 0.0005].map(|spacing| {
            let there = pair(&a, &b, spacing, model(w));
            let back = pair(&b, &a, spacing, model(w));
            let evaluator = |p| DirectEvaluator::new(p, &DirectOptions::FULL).expect("valid pair");
            let (there, back) = (evaluator(&there), evaluator(&back));
            let mut rng = SmallRng::seed_from_u64(20);
            let (mut error, mut size) = (0.0, 0.0);
            for _ in 0..4 {
                let pose = random_pose(&mut rng, 0.003);
                let f = there.score(&pose);
                error += (f - back.score(&pose.inverse())).norm_sqr();
                size += f.norm_sqr();
            }
            f64::sqrt(error / size)
        });
        assert!(
            errors[0] < 0.02 && errors[1] < 0.4 * errors[0],
            "w = {w}: {errors:?}"
        );
    }
}

/// Far away nothing acts, whatever the distance, and the numbers stay finite.
#[test]
fn far_poses_have_no_energy() {
    let pair = pair(&Blobs::new(21), &Blobs::new(22), 0.001, model(1.0));
    let direct = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
    for distance in [0.1, 1.0, 1e6, 1e30, 1e200] {
        let turn = DQuat::from_rotation_y(1.0);
        let response =
            direct.evaluate(&Pose::new(turn, DVec3::X * distance), &mut direct.scratch());
        assert_eq!(response.energy, 0.0);
        assert_eq!(response.wrench, fft_correlate::Wrench::ZERO);
    }
}

/// The limit on points is kept, and the error falls as it grows.
#[test]
fn more_points_are_more_accurate() {
    let pair = pair(&Blobs::new(23), &Blobs::new(24), 0.0005, model(0.0));
    let full = DirectEvaluator::new(&pair, &DirectOptions::FULL).expect("valid pair");
    let mut last = f64::INFINITY;
    for max in [1_000, 8_000, 40_000] {
        let options = DirectOptions {
            max_points: Some(max),
            ..DirectOptions::REAL_TIME
        };
        let direct = DirectEvaluator::new(&pair, &options).expect("valid pair");
        assert!(direct.describe().points() <= max, "{}", direct.describe());
        let mut rng = SmallRng::seed_from_u64(25);
        let (mut error, mut size) = (0.0, 0.0);
        for _ in 0..6 {
            let pose = random_pose(&mut rng, 0.003);
            let expected = full.evaluate(&pose, &mut full.scratch()).wrench.force;
            let found = direct.evaluate(&pose, &mut direct.scratch()).wrench.force;
            error += (found - expected).length_squared();
            size += expected.length_squared();
        }
        let error = f64::sqrt(error / size);
        assert!(error < 0.7 * last, "{max} points: {error}, before {last}");
        last = error;
    }
    assert!(last < 0.01, "{last}");
}

#[test]
fn bad_input_is_refused_with_what_was_found() {
    let good = pair(&Blobs::new(26), &Blobs::new(27), 0.002, model(0.0));
    let refuse = |options: DirectOptions| match DirectEvaluator::new(&good, &options) {
        Err(e) => e,
        Ok(_) => panic!("accepted {options:?}"),
    };
    let bad_tolerance = refuse(DirectOptions {
        merge_tolerance: -1.0,
        max_points: None,
    });
    assert!(
        matches!(bad_tolerance, DirectError::Option { name: "merge_tolerance", found, .. } if found == -1.0)
    );
    let no_points = refuse(DirectOptions {
        max_points: Some(0),
        ..DirectOptions::FULL
    });
    assert!(matches!(
        no_points,
        DirectError::Option {
            name: "max_points",
            ..
        }
    ));

    let rebuilt = |fixed: sdf_grid::DensityField| {
        let parts = (
            std::sync::Arc::new(fixed),
            std::sync::Arc::new(good.moving().clone()),
        );
        let pair = fft_correlate::Pair::new(parts.0, parts.1, *good.model(), DVec3::ZERO);
        DirectEvaluator::new(&pair.expect("matching fields"), &DirectOptions::FULL).err()
    };
    let mut poisoned = good.fixed().clone();
    poisoned.exterior[[1, 2, 3]].im = f32::NAN;
    assert!(matches!(
        rebuilt(poisoned),
        Some(DirectError::NotFinite {
            index: [1, 2, 3],
            ..
        })
    ));
    let mut hollow = good.fixed().clone();
    hollow.interior.fill(num_complex::Complex32::ZERO);
    assert!(matches!(rebuilt(hollow), Some(DirectError::Empty { .. })));
}
