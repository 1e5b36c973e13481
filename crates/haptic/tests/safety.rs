//! Adversarial input: no force over the limit, nothing that is not finite, no energy from nowhere.

mod common;

use common::{Well, workspace};
use fft_correlate::EnergySource;
use fft_correlate::{Pose, Twist};
use glam::{DQuat, DVec3};
use haptic::{DeviceState, ForcePath, HandConfig, HapticConfig, Sample, flags};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

const DT: f64 = 0.001;

/// Fastest hand in these tests, m/s.
const SPEED: f64 = 0.3;

fn path(config: &HapticConfig) -> ForcePath {
    let spec = HandConfig::default().spec();
    ForcePath::new(&spec, config, workspace(), Well::default().scratch()).unwrap()
}

fn vector(rng: &mut SmallRng, size: f64) -> DVec3 {
    DVec3::new(
        rng.random_range(-size..size),
        rng.random_range(-size..size),
        rng.random_range(-size..size),
    )
}

/// A hand that wanders smoothly near the fit, up to [`SPEED`].
struct Wanderer {
    pose: Pose,
    velocity: Twist,
}

impl Wanderer {
    fn new() -> Self {
        Self {
            pose: Pose::from_translation(DVec3::new(0.02, 0.0, 0.03)),
            velocity: Twist::default(),
        }
    }

    fn step(&mut self, rng: &mut SmallRng, dt: f64) -> Pose {
        let home = self.pose.twist_to(&Pose::IDENTITY);
        self.velocity.linear += vector(rng, 20.0) * dt.sqrt() * 0.1 + home.linear * (60.0 * dt);
        self.velocity.angular += vector(rng, 20.0) * dt.sqrt() * 0.3 + home.angular * (60.0 * dt);
        self.velocity = self.velocity * (1.0 - 2.0 * dt);
        self.velocity.linear = self.velocity.linear.clamp_length_max(SPEED);
        self.velocity.angular = self.velocity.angular.clamp_length_max(3.0);
        self.pose = self.pose.perturbed(&(self.velocity * dt));
        self.pose
    }
}

#[derive(Debug, Clone, Copy)]
enum Attack {
    None,
    Teleport,
    NotANumber,
    Stuck,
    Gone,
    Stall,
    Flip,
    NotARotation,
    Huge,
    FarFuture,
}

const ATTACKS: [Attack; 10] = [
    Attack::None,
    Attack::Teleport,
    Attack::NotANumber,
    Attack::Stuck,
    Attack::Gone,
    Attack::Stall,
    Attack::Flip,
    Attack::NotARotation,
    Attack::Huge,
    Attack::FarFuture,
];

impl Attack {
    /// What the device says of a hand at `pose`.
    fn say(self, rng: &mut SmallRng, pose: Pose, now: f64, tick: u64) -> Option<DeviceState> {
        let mut state = DeviceState::at(pose, now);
        match self {
            Self::None | Self::Stall => {}
            Self::Teleport => state.pose.translation += vector(rng, 0.2),
            Self::NotANumber => match rng.random_range(0..3) {
                0 => state.pose.translation.y = f64::NAN,
                1 => state.pose.rotation.w = f64::INFINITY,
                _ => state.timestamp = f64::NAN,
            },
            Self::Stuck => state.timestamp = now - 1.0,
            Self::Gone => return None,
            Self::Flip if tick.is_multiple_of(2) => state.pose.rotation = -pose.rotation,
            Self::Flip => {}
            Self::NotARotation => state.pose.rotation = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            Self::Huge => state.pose.translation *= 1e300,
            Self::FarFuture => state.timestamp = now + 1e9,
        }
        Some(state)
    }
}

fn assault(ticks: u64, seed: u64) {
    let config = HapticConfig {
        ramp_s: 0.02,
        ..HapticConfig::default()
    };
    let mut path = path(&config);
    let well = Well::default();
    let mut rng = SmallRng::seed_from_u64(seed);
    let mut hand = Wanderer::new();
    let (mut now, mut work_out, mut faults, mut felt) = (0.0, 0.0, 0u32, 0u64);
    let (mut attack, mut until) = (Attack::None, 0);
    let mut last: Option<(Pose, Sample)> = None;
    for tick in 0..ticks {
        if tick >= until {
            attack = ATTACKS[rng.random_range(0..ATTACKS.len())];
            if rng.random_bool(0.5) {
                attack = Attack::None;
            }
            faults += u32::from(!matches!(attack, Attack::None | Attack::Flip));
            until = tick + rng.random_range(1..200);
        }
        let dt = if matches!(attack, Attack::Stall) && rng.random_bool(0.1) {
            0.01
        } else {
            DT
        };
        now += dt;
        let pose = hand.step(&mut rng, dt);
        if let Some((before, sample)) = &last {
            work_out += sample.wrench.dot(&before.twist_to(&pose));
        }
        let state = attack.say(&mut rng, pose, now, tick);
        let sample = path.step(&well, state.as_ref(), now, dt);
        assert!(sample.wrench.is_finite(), "{tick} {attack:?}");
        assert!(sample.wrench.force.length() <= 5.0, "{tick} {attack:?}");
        assert!(sample.wrench.torque.length() <= 0.3, "{tick} {attack:?}");
        assert_eq!(sample.flags & flags::NOT_FINITE, 0, "{tick} {attack:?}");
        felt += u64::from(sample.wrench.force.length() > 0.5);
        last = Some((pose, sample));
    }
    assert!(felt > ticks / 50, "the field was felt at all: {felt}");
    // What the field holds may come out once. A fault may add a force that no longer fits the
    // pose, of at most the limits, over a few decay times while the hand moves on.
    let held = well.depth + well.funnel;
    let per_fault = (5.0 * SPEED + 0.3 * 3.0) * (5.0 * config.decay_s + 2.0 * 0.01);
    assert!(
        work_out < held + f64::from(faults) * per_fault,
        "{work_out} J, {faults} faults"
    );
}

#[test]
fn adversarial_input() {
    for seed in 0..4 {
        assault(250_000, seed);
    }
}

#[test]
#[ignore = "ten million ticks: about a minute"]
fn adversarial_input_long() {
    assault(10_000_000, 99);
}

#[test]
fn a_wandering_hand_gets_no_energy_from_nowhere() {
    let config = HapticConfig {
        ramp_s: 0.0,
        ..HapticConfig::default()
    };
    for seed in 0..4 {
        let mut path = path(&config);
        let well = Well::default();
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut hand = Wanderer::new();
        for tick in 0..60_000 {
            let now = tick as f64 * DT;
            let state = DeviceState::at(hand.step(&mut rng, DT), now);
            let sample = path.step(&well, Some(&state), now, DT);
            // The controller damps only as hard as it may, so a small deficit can stand for a
            // while: a tenth of a second of it at the limit force and 1 cm/s.
            assert!(sample.balance > -0.005, "{tick} {}", sample.balance);
        }
        let account = path.account();
        let held = well.depth + well.funnel;
        assert!(-account.work_in < held + 0.005, "{account:?}");
    }
}
