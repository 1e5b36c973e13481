use fft_correlate::Twist;
use glam::DVec3;

use super::*;

fn bundle(stiffness: f64) -> Bundle {
    Bundle::new(Metric::new(1.0, stiffness, false))
}

fn rest(bundle: &mut Bundle) -> Twist {
    let y = bundle.proximal_point();
    bundle.metric.twist(&y)
}

/// Evaluates `energy(x) , force(x)` along x at offsets from the device.
fn fill(bundle: &mut Bundle, at: &[f64], energy: impl Fn(f64) -> (f64, f64)) {
    for &x in at {
        let pose = Pose::from_translation(DVec3::new(x, 0.0, 0.0));
        let y = bundle.metric.scaled(&Pose::IDENTITY.twist_to(&pose));
        let (e, f) = energy(x);
        let wrench = Wrench {
            force: DVec3::new(f, 0.0, 0.0),
            ..Wrench::ZERO
        };
        bundle.add(pose, y, e, &wrench);
    }
}

#[test]
fn one_slope_is_balanced_by_the_spring() {
    // E = 3 x: the spring of 1000 N/m gives way by 3 mm against it.
    let mut bundle = bundle(1000.0);
    fill(&mut bundle, &[0.0], |x| (3.0 * x, -3.0));
    let twist = rest(&mut bundle);
    assert!((twist.linear.x - -0.003).abs() < 1e-12);
}

#[test]
fn a_kink_is_found_from_one_cut_on_each_side() {
    // E = 5 |x - 1 mm|; the device is 1 mm off, which the spring cannot tear out.
    let kink = |x: f64| (5.0 * (x - 0.001).abs(), -5.0 * (x - 0.001).signum());
    let mut bundle = bundle(1000.0);
    fill(&mut bundle, &[0.0, 0.0025], kink);
    let twist = rest(&mut bundle);
    // GAP allows 0.3 µm.
    assert!((twist.linear.x - 0.001).abs() < 3e-7, "{}", twist.linear.x);
}

#[test]
fn an_old_cut_does_not_hold_back_where_the_field_bends_down() {
    // E = -100 x² with a 1000 N/m spring: every new cut must decide alone.
    let dome = |x: f64| (-100.0 * x * x, 200.0 * x);
    let mut bundle = bundle(1000.0);
    fill(&mut bundle, &[0.001, 0.002, 0.003], dome);
    let twist = rest(&mut bundle);
    let newest = 200.0 * 0.003 / 1000.0;
    assert!((twist.linear.x - newest).abs() < 1e-6, "{}", twist.linear.x);
}

/// The dual climbed by small steps along the best pair, the slow way.
fn by_pairs(bundle: &Bundle) -> Six {
    let mut cuts = bundle.cuts.clone();
    for _ in 0..200_000 {
        let sum = cuts
            .iter()
            .fold([0.0; 6], |s, c| add_scaled(&s, &c.gradient, c.weight));
        let slopes: Vec<f64> = cuts.iter().map(|c| c.slope(&sum)).collect();
        let up = (0..cuts.len()).max_by(|a, b| slopes[*a].total_cmp(&slopes[*b]));
        let used = (0..cuts.len()).filter(|i| cuts[*i].weight > 0.0);
        let down = used.min_by(|a, b| slopes[*a].total_cmp(&slopes[*b]));
        let (up, down) = (up.unwrap(), down.unwrap());
        let change = add_scaled(&cuts[up].gradient, &cuts[down].gradient, -1.0);
        let climb = slopes[up] - slopes[down];
        if climb < 1e-15 {
            break;
        }
        let step = (climb / dot(&change, &change)).min(cuts[down].weight);
        cuts[up].weight += step;
        cuts[down].weight -= step;
    }
    cuts.iter()
        .fold([0.0; 6], |s, c| add_scaled(&s, &c.gradient, -c.weight))
}

#[test]
fn the_active_set_finds_what_pair_steps_find() {
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};
    let mut rng = SmallRng::seed_from_u64(5);
    for round in 0..60 {
        let mut bundle = bundle(1000.0);
        for _ in 0..rng.random_range(1..=CAPACITY) {
            let mut random = |size: f64| {
                DVec3::new(
                    rng.random_range(-size..size),
                    rng.random_range(-size..size),
                    rng.random_range(-size..size),
                )
            };
            let wrench = Wrench {
                torque: random(0.2),
                force: random(5.0),
            };
            let at = Pose::IDENTITY.perturbed(&Twist {
                angular: random(0.02),
                linear: random(0.001),
            });
            let y = bundle.metric.scaled(&Pose::IDENTITY.twist_to(&at));
            let energy = -0.9 * wrench.force.dot(at.translation);
            bundle.add(at, y, energy, &wrench);
        }
        let slow = by_pairs(&bundle);
        let fast = bundle.proximal_point();
        let apart = add_scaled(&slow, &fast, -1.0);
        // Half the square of the distance is within the gap of either solve.
        assert!(
            dot(&apart, &apart).sqrt() < 2.0 * (2.0 * GAP).sqrt(),
            "{round}"
        );
    }
}

#[test]
fn weights_stay_a_partition_when_cuts_are_dropped() {
    let bowl = |x: f64| (2000.0 * x * x, -4000.0 * x);
    let mut bundle = bundle(1000.0);
    for k in 0..60 {
        fill(&mut bundle, &[0.004 * (k as f64 * 2.4).sin()], bowl);
        bundle.proximal_point();
        let total: f64 = bundle.cuts.iter().map(|c| c.weight).sum();
        assert!((total - 1.0).abs() < 1e-9);
        assert!(bundle.cuts.len() <= CAPACITY);
    }
}
