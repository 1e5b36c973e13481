//! The paper's two tests and the quiet hand, on an analytic zero-clearance fit.

use std::sync::atomic::AtomicBool;

use crate::common::{Well, hand, workspace};
use fft_correlate::{EnergySource, Pose};
use haptic::{Clock, HapticConfig, OperatorConfig, Outcome, Script, Session, flags};

fn run(config: HapticConfig, hand_config: OperatorConfig, script: Script, seconds: f64) -> Outcome {
    let mut device = hand(hand_config, script);
    Session::new(config, workspace())
        .keep_samples()
        .run(
            &mut device,
            &Well::default(),
            Clock::Simulated,
            seconds,
            &AtomicBool::new(false),
        )
        .unwrap()
}

/// Root mean square of the part of `signal` above `cut` hertz, by Hann windows of 1024 samples.
fn rms_above(signal: &[f64], rate: f64, cut: f64) -> f64 {
    const N: usize = 1024;
    let mut planner = Vec::with_capacity(N);
    for k in 0..N {
        planner.push((std::f64::consts::TAU * k as f64 / N as f64).sin_cos());
    }
    let first = (cut / rate * N as f64).ceil() as usize;
    let (mut power, mut windows) = (0.0, 0);
    for chunk in signal.chunks_exact(N) {
        let mean = chunk.iter().sum::<f64>() / N as f64;
        for bin in first..N / 2 {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, value) in chunk.iter().enumerate() {
                let hann = 0.5 - 0.5 * planner[k].1;
                let (s, c) = planner[bin * k % N];
                re += (value - mean) * hann * c;
                im -= (value - mean) * hann * s;
            }
            power += re * re + im * im;
        }
        windows += 1;
    }
    // One-sided; the Hann window keeps 3/8 of the power.
    (2.0 * power / (0.375 * (N * N) as f64) / f64::from(windows)).sqrt()
}

#[test]
fn the_spectrum_measure_knows_a_sine() {
    let sine = |hz: f64| -> Vec<f64> {
        (0..8192)
            .map(|k| (std::f64::consts::TAU * hz * k as f64 / 1000.0).sin())
            .collect()
    };
    assert!((rms_above(&sine(120.0), 1000.0, 50.0) - 0.5f64.sqrt()).abs() < 0.01);
    assert!(rms_above(&sine(12.0), 1000.0, 50.0) < 1e-3);
}

#[test]
fn the_hand_in_the_hole_at_greatest_stiffness_does_not_buzz() {
    let mut config = HapticConfig::default();
    config.coupling.stiffness = 1e9;
    config.coupling.rotational_stiffness = 1e9;
    let quiet = OperatorConfig {
        push: 0.0,
        ..OperatorConfig::default()
    };
    let outcome = run(config, quiet, Script::Collision, 60.0);
    assert_eq!(outcome.report.stiffness, 3000.0, "the device's greatest");
    let settled = &outcome.samples[2000..];
    let felt: Vec<f64> = settled.iter().map(|s| s.wrench.force.x).collect();
    let buzz = rms_above(&felt, 1000.0, 50.0);
    // The paper reports "very rare undesirable vibration". 10 mN is below what a finger feels;
    // the well's walls are 4 N, and a field shown without coupling buzzes with all of that.
    assert!(buzz < 0.01, "{buzz} N above 50 Hz");
    let well = Well::default();
    let raw: Vec<f64> = settled
        .iter()
        .map(|s| {
            let device = s.input.unwrap().pose;
            well.evaluate(&device, &mut well.scratch()).wrench.force.x
        })
        .collect();
    let without = rms_above(&raw, 1000.0, 50.0);
    assert!(without > 20.0 * buzz, "{without} against {buzz}");
}

#[test]
fn the_snap_test_ends_seated() {
    for seed in 0..8 {
        let config = OperatorConfig {
            duration: 5.0,
            seed,
            ..OperatorConfig::default()
        };
        let outcome = run(HapticConfig::default(), config, Script::Snap, 5.0);
        let end = outcome.last.object;
        let away = end.translation.length();
        assert!(away < 2e-4, "seed {seed}: {:?}", end.translation);
        assert!(end.angle_to(&Pose::IDENTITY) < 0.01, "seed {seed}");
        let strayed = outcome
            .samples
            .iter()
            .map(|s| s.object.translation.length())
            .fold(0.0, f64::max);
        assert!(strayed > 0.01, "the hand did move away: {strayed}");
    }
}

#[test]
fn the_collision_test_does_not_push_through_the_wall() {
    // Walls of 4 N, pushes of 3 N: the object stays in the kink within the tolerance to which a
    // tick follows it, while the hand gives way by millimetres.
    let outcome = run(
        HapticConfig::default(),
        OperatorConfig::default(),
        Script::Collision,
        20.0,
    );
    let mut deepest: f64 = 0.0;
    let mut hand: f64 = 0.0;
    for s in &outcome.samples {
        deepest = deepest.max(s.object.translation.with_z(0.0).length());
        hand = hand.max(s.input.unwrap().pose.translation.with_z(0.0).length());
    }
    assert!(deepest < 1e-4, "{deepest}");
    assert!(hand > 1e-3, "{hand}");
    assert!(
        outcome.report.peak_force > 1.5,
        "{}",
        outcome.report.peak_force
    );
    assert!(outcome.report.peak_force < 4.5);
    assert!(
        outcome
            .samples
            .iter()
            .all(|s| s.flags & flags::NOT_FINITE == 0)
    );
}

#[test]
fn a_wall_holds_as_much_as_the_energy_makes_it_hold_and_no_more() {
    // Walls of 4 N and a funnel of 1 N against a push of 12 N, of which 6 N are left a centimetre
    // outside: the part goes through. Three times the energy, as three times the `peak_force`
    // makes it, and the same push ends at the wall, within what the hand is made to feel.
    let push = OperatorConfig {
        push: 12.0,
        ..OperatorConfig::default()
    };
    let mut config = HapticConfig::default();
    config.limits.force = 10.0;
    let farthest = |times: f64| {
        let well = Well {
            depth: times * Well::default().depth,
            funnel: times * Well::default().funnel,
            ..Well::default()
        };
        let mut device = hand(push.clone(), Script::Collision);
        let outcome = Session::new(config.clone(), workspace())
            .keep_samples()
            .run(
                &mut device,
                &well,
                Clock::Simulated,
                10.0,
                &AtomicBool::new(false),
            )
            .unwrap();
        let samples = outcome.samples.iter();
        let away = samples.map(|s| s.object.translation.with_z(0.0).length());
        away.fold(0.0, f64::max)
    };
    let (through, held) = (farthest(1.0), farthest(3.0));
    assert!(through > Well::default().across, "{through}");
    assert!(held < 1e-4, "{held}");
}

#[test]
fn fewer_evaluations_follow_the_wall_less_closely_but_hold() {
    let mut deepest = Vec::new();
    for evaluations in [1, 2, 8] {
        let mut config = HapticConfig::default();
        config.coupling.evaluations = evaluations;
        let outcome = run(config, OperatorConfig::default(), Script::Collision, 6.0);
        let samples = outcome.samples.iter();
        let depth = samples.map(|s| s.object.translation.with_z(0.0).length());
        deepest.push(depth.fold(0.0, f64::max));
    }
    assert!(deepest[0] < 5e-4 && deepest[2] <= deepest[0], "{deepest:?}");
}

/// The well as a single-precision table would give it: numbers that tremble in their last digits.
struct Noisy(Well);

impl EnergySource for Noisy {
    fn scratch(&self) -> fft_correlate::Scratch {
        self.0.scratch()
    }

    fn evaluate(
        &self,
        pose: &Pose,
        scratch: &mut fft_correlate::Scratch,
    ) -> fft_correlate::Response {
        let mut answer = self.0.evaluate(pose, scratch);
        // 1e-7 J and 5 mN: f32 energies of order one joule, a wrench 0.1 % off; a function of the
        // pose, as interpolation errors are.
        let p = pose.translation * 3e5;
        answer.energy += 1e-7 * (p.x + 2.0 * p.y + 3.0 * p.z).sin();
        answer.wrench.force.x += 0.005 * (2.0 * p.x - p.y).cos();
        answer
    }
}

#[test]
fn a_source_of_single_precision_does_not_make_it_buzz() {
    let quiet = OperatorConfig {
        push: 0.0,
        ..OperatorConfig::default()
    };
    let mut device = hand(quiet, Script::Collision);
    let outcome = Session::new(HapticConfig::default(), workspace())
        .keep_samples()
        .run(
            &mut device,
            &Noisy(Well::default()),
            Clock::Simulated,
            10.0,
            &AtomicBool::new(false),
        )
        .unwrap();
    let samples = outcome.samples[1000..].iter();
    let felt: Vec<f64> = samples.map(|s| s.wrench.force.x).collect();
    let buzz = rms_above(&felt, 1000.0, 50.0);
    assert!(buzz < 0.01, "{buzz}");
}
