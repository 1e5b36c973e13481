//! The bound on energy that a hand can get out, against a hand that knows how: it circles in a bowl
//! while every tick comes ten periods late, so that the held force drives it on.

use crate::common::workspace;
use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{DeviceState, ForcePath, HapticConfig, OperatorConfig};

/// A bowl, `E = c r² / 2`.
struct Bowl {
    /// N/m.
    stiffness: f64,
}

impl EnergySource for Bowl {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        Response {
            energy: 0.5 * self.stiffness * pose.translation.length_squared(),
            wrench: Wrench {
                force: pose.translation * -self.stiffness,
                ..Wrench::ZERO
            },
            coverage: 1.0,
        }
    }
}

/// Ten periods of 1 ms: late, yet no fault.
const DT: f64 = 0.01;

/// Metres from the bottom at which the hand starts; 4.5 N there, under every limit.
const START: f64 = 0.006;

/// Radius of the hand's path: it waits, spirals in to half, circles, and goes to the bottom.
fn radius(time: f64) -> f64 {
    let share = match time {
        t if t < 0.1 => 1.0,
        t if t < 1.1 => 1.0 - 0.5 * (t - 0.1),
        t if t < 19.0 => 0.5,
        t => 0.5 * (20.0 - t),
    };
    START * share
}

struct Run {
    /// Joules that the hand got out.
    out: f64,
    /// Joules that field and springs held at the start beyond those at the bottom.
    held: f64,
    credit: f64,
    /// Greatest work of one tick, joules: what may be out before the controller hears of it.
    tick: f64,
}

/// `turns` per second, 0 straight down.
fn circle(control: bool, turns: f64) -> Run {
    let mut config = HapticConfig {
        ramp_s: 0.0,
        ..HapticConfig::default()
    };
    config.passivity.control = control;
    let bowl = Bowl { stiffness: 3000.0 };
    let spec = OperatorConfig::default().spec();
    let mut path = ForcePath::new(&spec, &config, workspace(), bowl.scratch()).unwrap();
    let spring = path.gains().stiffness;
    let together = spring * bowl.stiffness / (spring + bowl.stiffness);
    let (mut out, mut tick) = (0.0, 0.0f64);
    let mut last: Option<(Pose, Wrench)> = None;
    for step in 0..=2000 {
        let time = f64::from(step) * DT;
        let angle = std::f64::consts::TAU * turns * time;
        let at = Pose::from_translation(radius(time) * DVec3::new(angle.cos(), angle.sin(), 0.0));
        if let Some((before, held)) = &last {
            let work = held.dot(&before.twist_to(&at));
            out += work;
            tick = tick.max(work);
        }
        let state = DeviceState::at_rest(at, time);
        let sample = path.step(&bowl, Some(&state), time, DT);
        // Full strength from the first input on, so that the start is held in full.
        last = Some((at, sample.wrench));
    }
    Run {
        out,
        held: 0.5 * together * START * START,
        credit: config.passivity.credit,
        tick,
    }
}

impl Run {
    fn bound(&self) -> f64 {
        self.held + self.credit + self.tick
    }
}

#[test]
fn the_bound_on_energy_holds_is_tight_and_needs_the_controller() {
    let straight = circle(true, 0.0);
    let with = circle(true, 5.0);
    let without = circle(false, 5.0);
    for (name, run) in [
        ("straight down", &straight),
        ("circling", &with),
        ("circling, controller off", &without),
    ] {
        println!(
            "{name}: {:.1} mJ of {:.1} mJ",
            1e3 * run.out,
            1e3 * run.bound()
        );
    }
    // What is held can be had, so the bound is tight,
    assert!(straight.out > 0.8 * straight.bound() && straight.out <= straight.bound());
    // what a late force adds cannot,
    assert!(with.out <= with.bound());
    // and it could, again and again, if the controller did nothing.
    assert!(without.out > 10.0 * without.bound());
}
