//! The energy source is exchanged while the loop runs: nothing stops, nothing knocks, and the
//! energy books say what was brought.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::common::{Well, workspace};
use fft_correlate::{EnergySource, Placement, Pose, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, LiveSource, OperatorConfig,
    Outcome, PlacedSource, Session, SharedSource, SumSource, flags,
};

/// Held still beside the fit; exchanges the source at one poll.
struct Holder {
    spec: DeviceSpec,
    polls: u64,
    live: Arc<LiveSource>,
    at: u64,
    next: Option<SumSource>,
}

impl Device for Holder {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        if self.polls == self.at
            && let Some(next) = self.next.take()
        {
            self.live.publish(next);
        }
        self.polls += 1;
        let pose = Pose::from_translation(DVec3::new(0.003, 0.0, 0.001));
        Ok(DeviceState::at_rest(pose, now))
    }

    fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn sum(wells: &[(Well, DVec3)]) -> SumSource {
    let placed = wells.iter().map(|(well, at)| PlacedSource {
        source: Some(SharedSource::new(Arc::new(*well))),
        placement: Placement::of_fixed(Pose::from_translation(*at)),
        reach: None,
    });
    SumSource::new(DVec3::ZERO, placed.collect())
}

fn run(before: SumSource, after: SumSource) -> Outcome {
    let live = Arc::new(LiveSource::new(before, &Pose::IDENTITY));
    let mut device = Holder {
        spec: OperatorConfig::default().spec(),
        polls: 0,
        live: Arc::clone(&live),
        at: 2000,
        next: Some(after),
    };
    Session::new(HapticConfig::default(), workspace())
        .keep_samples()
        .run(
            &mut device,
            live.as_ref(),
            Clock::Simulated,
            4.0,
            &AtomicBool::new(false),
        )
        .unwrap()
}

#[test]
fn a_part_that_changes_under_the_hand_comes_in_from_no_force() {
    let strong = Well {
        depth: 0.08,
        ..Well::default()
    };
    let outcome = run(
        sum(&[(Well::default(), DVec3::ZERO)]),
        sum(&[(strong, DVec3::ZERO)]),
    );
    assert_eq!(outcome.report.ticks, 4000);
    assert_eq!(outcome.report.changes, 1);
    let s = &outcome.samples;
    assert!(s[2000].flags & flags::CHANGED != 0);
    assert_eq!(s[2000].gain, 0.0);
    assert!(s[1999].wrench.force.length() > 1.0, "the wall was felt");
    let rate = HapticConfig::default().limits.force_rate;
    for pair in s.windows(2) {
        let step = (pair[1].wrench.force - pair[0].wrench.force).length();
        // The slew limit, and the rounding of its own arithmetic.
        assert!(
            step <= rate * 1e-3 * (1.0 + 1e-9),
            "{} {step}",
            pair[1].tick
        );
    }
    assert!(s[2010].wrench.force.length() < 0.2, "let go");
    assert!(s[3999].wrench.force.length() > 1.0, "and felt again");
    // What the new well holds beyond the old one where the part is, and no balance lost for it.
    let (old, new) = (Well::default(), strong);
    let at = s[1999].object;
    let energy = |w: Well| w.evaluate(&at, &mut w.scratch()).energy;
    let brought = energy(new) - energy(old);
    let told = outcome.report.energy.exchanged;
    assert!(
        (told - brought).abs() < 1e-3 * brought.abs(),
        "{told} {brought}"
    );
    let least = s.iter().map(|s| s.account.balance).fold(1.0, f64::min);
    assert!(least > -1e-4, "{least}");
}

#[test]
fn a_part_that_is_loaded_far_away_is_not_felt() {
    let here = (Well::default(), DVec3::ZERO);
    let there = (Well::default(), DVec3::new(0.5, 0.0, 0.0));
    let outcome = run(sum(&[here]), sum(&[here, there]));
    let s = &outcome.samples;
    assert!(s[2000].flags & flags::CHANGED != 0);
    assert_eq!(s[2000].gain, 1.0);
    let before = s[1999].wrench.force;
    let after = s[2000..2100].iter();
    let most = after
        .map(|s| (s.wrench.force - before).length())
        .fold(0.0, f64::max);
    // The object is found to 4 mN anyway.
    assert!(most < 0.008, "{most}");
}
