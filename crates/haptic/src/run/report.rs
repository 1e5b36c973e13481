//! What a run was like, counted while it runs.

use web_time::Instant;

use glam::DVec3;
use hdrhistogram::Histogram;
use serde::Serialize;

use crate::device::contract::DeviceSpec;
use crate::path::coupling::Gains;
use crate::path::passivity::EnergyAccount;
use crate::path::sample::{Sample, flags};
use crate::run::pace::{Clock, TickTimes};
use crate::run::realtime::RealtimeGrant;

/// Longest time that a histogram resolves, nanoseconds.
const LONGEST: u64 = 60_000_000_000;

/// Quantiles of a distribution of times, microseconds.
///
/// ```
/// use haptic::Quantiles;
/// use hdrhistogram::Histogram;
///
/// // Times of 1, 2, ... 1000 microseconds, in nanoseconds.
/// let mut times = Histogram::new(3)?;
/// for microseconds in 1..=1000 {
///     times.record(1000 * microseconds)?;
/// }
/// let quantiles = Quantiles::from_histogram(&times);
/// assert!((quantiles.p50 - 500.0).abs() < 1.0 && (quantiles.max - 1000.0).abs() < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Quantiles {
    /// Half are below.
    pub p50: f64,
    /// 99 of 100 are below.
    pub p99: f64,
    /// 999 of 1000 are below.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

impl Quantiles {
    /// Of a histogram of nanoseconds.
    pub fn from_histogram(nanoseconds: &Histogram<u64>) -> Self {
        let at = |q| nanoseconds.value_at_quantile(q) as f64 * 1e-3;
        Self {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: at(1.0),
        }
    }
}

/// Counts, times and extremes of a run.
///
/// See the example of [`Session`](crate::Session).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopReport {
    /// Which clock it ran on.
    pub clock: Clock,
    /// The device's name.
    pub device: String,
    /// Ticks done.
    pub ticks: u64,
    /// Seconds on the loop's clock.
    pub seconds: f64,
    /// Mean rate on the loop's clock, Hz.
    pub rate_hz: f64,
    /// Computing time per tick, microseconds, on the wall clock.
    pub latency_us: Quantiles,
    /// Start of each tick after its deadline, microseconds; zeros in simulated time.
    pub lateness_us: Quantiles,
    /// Ticks that ended after the next one's deadline.
    pub overruns: u64,
    /// Deadlines left out because of overruns.
    pub missed: u64,
    /// Ticks with no, bad, stale or jumping input.
    pub input_faults: u64,
    /// Times the energy source was exchanged ([`flags::CHANGED`]).
    pub changes: u64,
    /// Ticks in which a part in reach, or rotations of its table that matter, were not in memory
    /// ([`flags::NOT_LOADED`]).
    pub not_loaded: u64,
    /// Ticks in which the part was outside the table, where its energy fades ([`flags::OUTSIDE`]).
    pub outside: u64,
    /// Greatest force sent in one of them, N.
    pub outside_force: f64,
    /// Ticks in which the passivity controller acted.
    pub damped: u64,
    /// Wrenches the device did not take.
    pub not_sent: u64,
    /// Samples the log has not got: zero unless the disk stood still for many seconds.
    pub dropped_samples: u64,
    /// Evaluations of the energy source.
    pub evaluations: u64,
    /// Greatest force sent, N.
    pub peak_force: f64,
    /// Greatest torque sent, N·m.
    pub peak_torque: f64,
    /// Coupling stiffness in use, N/m.
    pub stiffness: f64,
    /// Rotational coupling stiffness in use, N·m/rad.
    pub rotational_stiffness: f64,
    /// Energy bookkeeping, joules.
    pub energy: EnergyAccount,
    /// What the operating system granted.
    pub granted: RealtimeGrant,
}

/// The result of a run: its report, the last sample and, if asked for, all samples.
///
/// See the example of [`Session`](crate::Session).
#[derive(Debug)]
pub struct Outcome {
    /// Counts and quantiles.
    pub report: LoopReport,
    /// Every sample, if [`crate::Session::keep_samples`] was asked for.
    pub samples: Vec<Sample>,
    /// The last sample.
    pub last: Sample,
    /// Computing time per tick, nanoseconds.
    pub latency: Histogram<u64>,
    /// Start after deadline, nanoseconds.
    pub lateness: Histogram<u64>,
    /// When the first tick was due.
    pub began: Instant,
}

/// Counts of a run so far; counting allocates nothing.
pub(crate) struct Tally {
    pub(crate) latency: Histogram<u64>,
    pub(crate) lateness: Histogram<u64>,
    pub(crate) last: Sample,
    seconds: f64,
    ticks: u64,
    overruns: u64,
    input_faults: u64,
    outside_force: f64,
    evaluations: u64,
    peak_force: f64,
    peak_torque: f64,
    timing: Timing,
    flagged: [u64; flags::NAMES.len()],
}

fn histogram() -> Histogram<u64> {
    // Bounds and digits are constants in range.
    Histogram::new_with_bounds(1, LONGEST, 3).expect("constant bounds")
}

impl Tally {
    pub(crate) fn new() -> Self {
        Self {
            latency: histogram(),
            lateness: histogram(),
            last: Sample::default(),
            seconds: 0.0,
            ticks: 0,
            overruns: 0,
            input_faults: 0,
            outside_force: 0.0,
            evaluations: 0,
            peak_force: 0.0,
            peak_torque: 0.0,
            timing: Timing::default(),
            flagged: [0; flags::NAMES.len()],
        }
    }

    pub(crate) fn count(&mut self, sample: &Sample) {
        let has = |bits: u16| u64::from(sample.flags & bits != 0);
        let [force, torque] = [sample.wrench.force, sample.wrench.torque].map(DVec3::length);
        self.ticks += 1;
        self.seconds = sample.time + sample.dt.min(1.0);
        self.input_faults += has(flags::NO_INPUT | flags::BAD_INPUT | flags::STALE | flags::JUMP);
        self.evaluations += u64::from(sample.evaluations);
        self.peak_force = self.peak_force.max(force);
        self.peak_torque = self.peak_torque.max(torque);
        if has(flags::OUTSIDE) > 0 {
            self.outside_force = self.outside_force.max(force);
        }
        for (bit, count) in self.flagged.iter_mut().enumerate() {
            *count += has(1 << bit);
        }
        self.last = *sample;
    }

    pub(crate) fn time(&mut self, spent: &TickTimes) {
        self.latency.saturating_record(spent.latency);
        self.lateness.saturating_record(spent.lateness);
        self.overruns += u64::from(spent.skipped > 0);
        self.timing.count(spent);
    }

    /// What viewers see of a tick that began at `at`.
    pub(crate) fn view(&self, sample: &Sample, at: Instant) -> View {
        View {
            sample: *sample,
            at: Some(at),
            timing: self.timing,
            flagged: self.flagged,
        }
    }

    /// The report, but for what only the session knows: `dropped` samples and what was `granted`.
    pub(crate) fn report(
        &self,
        clock: Clock,
        device: &DeviceSpec,
        gains: &Gains,
        dropped: u64,
        granted: RealtimeGrant,
    ) -> LoopReport {
        let count = |flag: u16| self.flagged[flag.trailing_zeros() as usize];
        LoopReport {
            clock,
            device: device.name.clone(),
            ticks: self.ticks,
            seconds: self.seconds,
            rate_hz: if self.seconds > 0.0 {
                self.ticks as f64 / self.seconds
            } else {
                0.0
            },
            latency_us: Quantiles::from_histogram(&self.latency),
            lateness_us: Quantiles::from_histogram(&self.lateness),
            overruns: self.overruns,
            missed: self.timing.missed,
            input_faults: self.input_faults,
            changes: count(flags::CHANGED),
            not_loaded: count(flags::NOT_LOADED),
            outside: count(flags::OUTSIDE),
            outside_force: self.outside_force,
            damped: count(flags::DAMPED),
            not_sent: count(flags::NOT_SENT),
            dropped_samples: dropped,
            evaluations: self.evaluations,
            peak_force: self.peak_force,
            peak_torque: self.peak_torque,
            stiffness: gains.stiffness,
            rotational_stiffness: gains.rotational_stiffness,
            energy: self.last.account,
            granted,
        }
    }
}

/// Ticks over which the worst times are kept.
const BLOCK: u64 = 1000;

/// The newest sample and the counts up to it: a viewer that looks seldom misses no fault.
///
/// See the example of [`SteppedLoop`](crate::SteppedLoop).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct View {
    /// The newest sample.
    pub sample: Sample,
    /// When its tick began; `None` before the first.
    pub at: Option<Instant>,
    /// Times of the ticks before it.
    pub timing: Timing,
    /// In how many ticks each of [`flags::NAMES`] was set, this one's included.
    pub flagged: [u64; flags::NAMES.len()],
}

/// Times of the ticks so far, nanoseconds on the wall clock.
///
/// See the example of [`SteppedLoop`](crate::SteppedLoop).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timing {
    /// Ticks done.
    pub ticks: u64,
    /// Deadlines left out because a tick took too long.
    pub missed: u64,
    /// Sum of the computing times.
    pub latency: u64,
    /// Sum of the starts after their deadlines.
    pub lateness: u64,
    /// Greatest computing time of the last full thousand ticks.
    pub worst_latency: u64,
    /// Greatest start after a deadline of the last full thousand ticks.
    pub worst_lateness: u64,
    block: [u64; 2],
}

impl Timing {
    pub(crate) fn count(&mut self, spent: &TickTimes) {
        self.ticks += 1;
        self.missed += u64::from(spent.skipped);
        self.latency = self.latency.saturating_add(spent.latency);
        self.lateness = self.lateness.saturating_add(spent.lateness);
        let [latency, lateness] = self.block;
        self.block = [latency.max(spent.latency), lateness.max(spent.lateness)];
        if self.ticks.is_multiple_of(BLOCK) {
            [self.worst_latency, self.worst_lateness] = std::mem::take(&mut self.block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_is_that_of_the_last_full_block() {
        let mut timing = Timing::default();
        for tick in 0..2 * BLOCK {
            timing.count(&TickTimes {
                latency: if tick == 3 { 900 } else { 10 },
                lateness: if tick == BLOCK + 3 { 700 } else { 5 },
                skipped: u32::from(tick == 7),
            });
            if tick == BLOCK {
                assert_eq!((timing.worst_latency, timing.worst_lateness), (900, 5));
            }
        }
        assert_eq!((timing.worst_latency, timing.worst_lateness), (10, 700));
        assert_eq!((timing.ticks, timing.missed), (2 * BLOCK, 1));
        assert_eq!(timing.lateness, 5 * (2 * BLOCK - 1) + 700);
    }
}
