//! Adversarial input: no force over the limit, nothing that is not finite, no energy from nowhere.

use crate::common::{Well, workspace};
use fft_correlate::EnergySource;
use fft_correlate::{Pose, Twist};
use glam::{DQuat, DVec3};
use haptic::{DeviceState, ForcePath, HapticConfig, OperatorConfig, Sample, flags};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

const DT: f64 = 0.001;

/// Fastest hand in these tests, m/s.
const SPEED: f64 = 0.3;

/// Fastest turning, rad/s.
const SPIN: f64 = 3.0;

fn path(config: &HapticConfig) -> ForcePath {
    let spec = OperatorConfig::default().spec();
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
        self.velocity.angular = self.velocity.angular.clamp_length_max(SPIN);
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
    /// Half of the time none.
    fn any(rng: &mut SmallRng) -> Self {
        let attack = ATTACKS[rng.random_range(0..ATTACKS.len())];
        match rng.random_bool(0.5) {
            true => Self::None,
            false => attack,
        }
    }

    /// The device tells the truth, if not in time.
    fn is_honest(self) -> bool {
        matches!(self, Self::None | Self::Flip | Self::Stall)
    }

    /// What the device says of a hand at `pose`.
    fn say(self, rng: &mut SmallRng, pose: Pose, now: f64, tick: u64) -> Option<DeviceState> {
        let mut state = DeviceState::at_rest(pose, now);
        match self {
            Self::None | Self::Stall | Self::Stuck => {}
            // Never so near that a hand could have got there.
            Self::Teleport => {
                let away = vector(rng, 0.2);
                state.pose.translation += away + away.normalize_or(DVec3::X) * 0.02;
            }
            Self::NotANumber => match rng.random_range(0..3) {
                0 => state.pose.translation.y = f64::NAN,
                1 => state.pose.rotation.w = f64::INFINITY,
                _ => state.timestamp = f64::NAN,
            },
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

/// What a run of attacks came to.
#[derive(Debug, Default)]
struct Toll {
    /// Work the hand really got out, joules.
    work_out: f64,
    /// What it may have got out at most, joules.
    bound: f64,
    /// Greatest share of its own bound that one fault let out unseen.
    worst_fault: f64,
    /// Times the force was let go and raised again.
    ramps: f64,
    faults: u32,
    felt: u64,
}

/// Watts that the limits allow against the fastest hand of these tests.
const POWER: f64 = 5.0 * SPEED + 0.3 * SPIN;

/// Joules that one fault may let out beyond what the loop's own books say, if it takes `unseen`
/// seconds to be noticed: until then the force stays, then it falls with the decay time; what
/// the hand did meanwhile may be booked at once against the force that is left.
fn fault_bound(config: &HapticConfig, unseen: f64) -> f64 {
    POWER * (2.0 * unseen + config.decay_s * (1.0 + (-1f64).exp()) + 2.0 * DT)
}

/// What is known of a run from outside the loop.
#[derive(Default)]
struct Books {
    toll: Toll,
    last: Option<(Pose, Sample)>,
    /// Since the last quiet tick: work that the loop did not see, and the bound of what went on.
    unseen: f64,
    allowed: f64,
}

impl Books {
    /// An attack begins.
    fn begin(&mut self, attack: Attack, config: &HapticConfig) {
        if attack.is_honest() {
            return;
        }
        let time = match attack {
            Attack::Stuck => config.stale_s,
            _ => DT,
        };
        self.toll.faults += 1;
        self.allowed += fault_bound(config, time);
        self.toll.bound += fault_bound(config, time);
    }

    /// A tick has ended, in which the loop booked so much work.
    fn tick(&mut self, attack: Attack, pose: Pose, sample: Sample, booked: f64) {
        let tick = sample.tick;
        if let Some((was, held)) = &self.last {
            let work = held.wrench.dot(&was.twist_to(&pose));
            self.toll.work_out += work;
            self.unseen += work - booked;
            self.toll.ramps += (sample.gain - held.gain).max(0.0);
        }
        let (unseen, allowed) = (self.unseen, self.allowed);
        let quiet = attack.is_honest() && sample.flags & FAULTS == 0;
        if quiet && allowed > 0.0 {
            assert!(unseen <= allowed, "{tick} {attack:?} {unseen} {allowed}");
            self.toll.worst_fault = self.toll.worst_fault.max(unseen / allowed);
            (self.unseen, self.allowed) = (0.0, 0.0);
        } else if quiet {
            // Seen as it happened, up to the rounding of sums.
            assert!(unseen.abs() < 1e-9, "{tick} {attack:?} {unseen}");
            self.unseen = 0.0;
        }
        self.toll.felt += u64::from(sample.wrench.force.length() > 0.5);
        self.last = Some((pose, sample));
    }
}

/// Limits hold and numbers are finite.
fn check(sample: &Sample, attack: Attack) {
    let tick = sample.tick;
    assert!(sample.wrench.is_finite(), "{tick} {attack:?}");
    assert!(sample.wrench.force.length() <= 5.0, "{tick} {attack:?}");
    assert!(sample.wrench.torque.length() <= 0.3, "{tick} {attack:?}");
    assert!(sample.account.balance.is_finite(), "{tick} {attack:?}");
    assert_eq!(sample.flags & flags::NOT_FINITE, 0, "{tick} {attack:?}");
}

/// Ticks under attack. Every tick: limits hold, numbers are finite. Every fault: what the hand got
/// out that the loop did not see is bounded. In all: work out is bounded by what the field holds,
/// once and once more per ramp, by the faults, and by the credit.
fn assault(ticks: u64, seed: u64) -> Toll {
    let config = HapticConfig {
        ramp_s: 0.02,
        ..HapticConfig::default()
    };
    let mut path = path(&config);
    let well = Well::default();
    let gains = path.gains();
    // Energies between the bottom of the well and both springs stretched to their limits.
    let held = well.depth
        + well.funnel
        + 0.5 * 25.0 / gains.stiffness
        + 0.5 * 0.09 / gains.rotational_stiffness;
    let mut books = Books::default();
    books.toll.bound = held + config.passivity.credit;
    let mut rng = SmallRng::seed_from_u64(seed);
    let mut hand = Wanderer::new();
    let (mut now, mut attack, mut until) = (0.0, Attack::None, 0);
    let mut frozen = DeviceState::at_rest(hand.pose, 0.0);
    for tick in 0..ticks {
        if tick >= until {
            attack = Attack::any(&mut rng);
            books.begin(attack, &config);
            frozen = DeviceState::at_rest(hand.pose, now);
            until = tick + rng.random_range(1..200);
        }
        let stalls = matches!(attack, Attack::Stall) && rng.random_bool(0.1);
        let dt = if stalls { 0.01 } else { DT };
        now += dt;
        let pose = hand.step(&mut rng, dt);
        let before = path.account().work_in();
        let state = match attack {
            Attack::Stuck => Some(frozen),
            other => other.say(&mut rng, pose, now, tick),
        };
        let sample = path.step(&well, state.as_ref(), now, dt);
        check(&sample, attack);
        let booked = -(path.account().work_in() - before);
        books.tick(attack, pose, sample, booked);
    }
    let mut toll = books.toll;
    toll.bound += toll.ramps * held;
    assert!(toll.felt > ticks / 50, "the field was felt: {toll:?}");
    assert!(toll.work_out < toll.bound, "{toll:?}");
    toll
}

/// Flags that tell of an input that was not followed.
const FAULTS: u16 = flags::NO_INPUT | flags::BAD_INPUT | flags::STALE | flags::JUMP | flags::LATE;

#[test]
fn adversarial_input() {
    for seed in 0..4 {
        let toll = assault(50_000, seed);
        println!("{toll:?}");
    }
}

#[test]
#[ignore = "ten million ticks: about a minute; see docs/haptics.md for what came out"]
fn adversarial_input_long() {
    let toll = assault(10_000_000, 99);
    println!("{toll:?}");
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
            let state = DeviceState::at_rest(hand.step(&mut rng, DT), now);
            let sample = path.step(&well, Some(&state), now, DT);
            // The controller damps only as hard as it may, so a small deficit can stand for a
            // while: a tenth of a second of it at the limit force and 1 cm/s.
            assert!(
                sample.account.balance > -0.005,
                "{tick} {}",
                sample.account.balance
            );
        }
        let account = path.account();
        let held = well.depth + well.funnel;
        assert!(-account.work_in() < held + 0.005, "{account:?}");
    }
}
