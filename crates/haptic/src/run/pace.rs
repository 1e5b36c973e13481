//! When ticks are due: absolute deadlines on the wall clock, a count of periods, or the times of a
//! recording.

use web_time::{Duration, Instant};

use serde::Serialize;

use crate::config::HapticConfig;
use crate::log::replay::Tick;
use crate::run::realtime;

/// The clock by which a session runs.
///
/// See the example of [`Session`](crate::Session).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The wall clock, one tick per period.
    Real,
    /// A count of periods, without waiting: the same inputs give the same forces on any machine.
    Simulated,
}

/// What the times of ticks are taken from.
pub(crate) enum TickSource {
    /// The wall clock.
    Wall,
    /// A count of periods.
    Count,
    /// A recording; the run ends with it.
    Recorded(Vec<Tick>),
}

impl TickSource {
    pub(crate) fn from_clock(clock: Clock) -> Self {
        match clock {
            Clock::Real => Self::Wall,
            Clock::Simulated => Self::Count,
        }
    }

    /// Whose seconds count.
    pub(crate) fn clock(&self) -> Clock {
        match self {
            Self::Wall => Clock::Real,
            Self::Count | Self::Recorded(_) => Clock::Simulated,
        }
    }
}

/// The times of one run's ticks.
pub(crate) struct Pace {
    source: TickSource,
    period: Duration,
    seconds: f64,
    spin: Duration,
    begin: Instant,
    deadline: Instant,
    last: Instant,
    ticks: usize,
    skipped: u32,
}

/// A tick that is due.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DueTick {
    /// Seconds on the loop's clock.
    pub(crate) now: f64,
    /// Seconds since the run began.
    pub(crate) elapsed: f64,
    /// Seconds since the last tick.
    pub(crate) dt: f64,
    /// Deadlines left out before this one.
    pub(crate) skipped: u32,
    /// On the wall clock.
    pub(crate) start: Instant,
}

/// What a tick took, nanoseconds on the wall clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TickTimes {
    pub(crate) latency: u64,
    /// Start after the deadline; 0 in simulated time.
    pub(crate) lateness: u64,
    /// Deadlines that passed before it ended.
    pub(crate) skipped: u32,
}

impl Pace {
    pub(crate) fn new(source: TickSource, config: &HapticConfig) -> Self {
        let begin = Instant::now();
        let period = Duration::from_secs_f64(config.period());
        Self {
            source,
            period,
            seconds: config.period(),
            spin: Duration::from_micros(config.spin_us.into()),
            begin,
            deadline: begin,
            last: begin.checked_sub(period).unwrap_or(begin),
            ticks: 0,
            skipped: 0,
        }
    }

    /// When the run began.
    pub(crate) fn begin(&self) -> Instant {
        self.begin
    }

    /// Waits for the next tick; `None` after the last one of a recording.
    pub(crate) fn wait(&mut self) -> Option<DueTick> {
        match &self.source {
            TickSource::Wall => Some(self.wait_for_deadline()),
            TickSource::Count => {
                let now = self.ticks as f64 * self.seconds;
                Some(DueTick {
                    now,
                    elapsed: now,
                    dt: self.seconds,
                    skipped: 0,
                    start: Instant::now(),
                })
            }
            TickSource::Recorded(ticks) => ticks.get(self.ticks).map(|tick| DueTick {
                now: tick.time,
                // A recording may have begun in the middle of a run.
                elapsed: tick.time - ticks[0].time,
                dt: tick.dt,
                skipped: tick.overrun.into(),
                start: Instant::now(),
            }),
        }
    }

    /// Seconds until the next tick on the wall clock; zero if it is due.
    pub(crate) fn seconds_ahead(&self) -> f64 {
        let ahead = self.deadline.saturating_duration_since(Instant::now());
        ahead.as_secs_f64()
    }

    fn wait_for_deadline(&mut self) -> DueTick {
        realtime::sleep_until(self.deadline, self.spin);
        self.begin_tick()
    }

    /// The tick on the wall clock that begins now.
    pub(crate) fn begin_tick(&self) -> DueTick {
        let start = Instant::now();
        let now = (start - self.begin).as_secs_f64();
        DueTick {
            now,
            elapsed: now,
            dt: (start - self.last).as_secs_f64(),
            skipped: self.skipped,
            start,
        }
    }

    /// Ends a tick and sets the next deadline.
    pub(crate) fn finish(&mut self, due: &DueTick) -> TickTimes {
        let end = Instant::now();
        let latency = nanoseconds(end - due.start);
        self.ticks += 1;
        if self.source.clock() == Clock::Simulated {
            return TickTimes {
                latency,
                lateness: 0,
                skipped: 0,
            };
        }
        let lateness = nanoseconds(due.start - self.deadline);
        self.last = due.start;
        self.skipped = ticks_skipped(self.deadline, end, self.period);
        self.deadline += self.period * (self.skipped + 1);
        TickTimes {
            latency,
            lateness,
            skipped: self.skipped,
        }
    }
}

/// Deadlines after `deadline` that passed before `end`. They are left out: catching up in a burst
/// would show the device several forces at once.
fn ticks_skipped(deadline: Instant, end: Instant, period: Duration) -> u32 {
    let past = end.saturating_duration_since(deadline).as_nanos() / period.as_nanos().max(1);
    u32::try_from(past).unwrap_or(u32::MAX - 1)
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deadlines_that_passed_are_left_out_not_caught_up() {
        let period = Duration::from_millis(1);
        let deadline = Instant::now();
        let end = |micros| deadline + Duration::from_micros(micros);
        assert_eq!(ticks_skipped(deadline, end(300), period), 0);
        assert_eq!(ticks_skipped(deadline, end(999), period), 0);
        assert_eq!(ticks_skipped(deadline, end(1001), period), 1);
        assert_eq!(ticks_skipped(deadline, end(10_500), period), 10);
    }

    #[test]
    fn a_slow_tick_is_followed_by_no_burst() {
        let config = HapticConfig {
            rate_hz: 1000.0,
            ..HapticConfig::default()
        };
        let mut pace = Pace::new(TickSource::Wall, &config);
        let due = pace.wait().unwrap();
        std::thread::sleep(Duration::from_millis(5));
        let skipped = pace.finish(&due).skipped;
        assert!(skipped >= 5, "{skipped}");
        let next = pace.wait().unwrap();
        assert_eq!(next.skipped, skipped);
        // The next tick keeps to the grid of deadlines that began with the run.
        assert!(next.now >= f64::from(skipped + 1) * 1e-3);
        assert!(next.dt >= 5e-3);
    }

    #[test]
    fn simulated_time_is_a_count_of_periods() {
        let config = HapticConfig::default();
        let mut pace = Pace::new(TickSource::Count, &config);
        for tick in 0..5 {
            let due = pace.wait().unwrap();
            assert_eq!((due.now, due.dt), (f64::from(tick) * 1e-3, 1e-3));
            assert_eq!(pace.finish(&due).lateness, 0);
        }
    }

    #[test]
    fn a_recording_gives_its_own_times_and_ends() {
        let tick = |time, dt, overrun| Tick { time, dt, overrun };
        let ticks = vec![tick(7.0, 1e-3, false), tick(7.0053, 5.3e-3, true)];
        let mut pace = Pace::new(TickSource::Recorded(ticks), &HapticConfig::default());
        let first = pace.wait().unwrap();
        assert_eq!((first.now, first.elapsed, first.skipped), (7.0, 0.0, 0));
        assert_eq!(pace.finish(&first).skipped, 0);
        let next = pace.wait().unwrap();
        assert_eq!((next.now, next.dt, next.skipped), (7.0053, 5.3e-3, 1));
        assert!((next.elapsed - 5.3e-3).abs() < 1e-12);
        pace.finish(&next);
        assert!(pace.wait().is_none());
    }
}
