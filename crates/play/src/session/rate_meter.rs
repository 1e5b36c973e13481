//! Rate and times of the loop over the last second, from occasional readings.

use std::collections::VecDeque;
use web_time::{Duration, Instant};

use haptic::Timing;

/// Time over which means are taken.
const WINDOW: Duration = Duration::from_secs(1);

/// Least time between two readings that are kept.
const APART: Duration = Duration::from_millis(50);

/// Looks of the last second at a loop's counts.
#[derive(Debug, Default)]
pub(crate) struct RateMeter {
    readings: VecDeque<(Instant, Timing)>,
}

/// Means over the last second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Means {
    /// Ticks per second.
    pub(crate) rate: f64,
    /// Computing time, µs.
    pub(crate) latency: f64,
    /// Start after the deadline, µs.
    pub(crate) lateness: f64,
}

impl RateMeter {
    /// Adds the counts up to a tick that began at `at`.
    pub(crate) fn update(&mut self, at: Instant, timing: &Timing) -> Means {
        let newest = self.readings.back();
        if newest.is_none_or(|(last, _)| at.saturating_duration_since(*last) >= APART) {
            self.readings.push_back((at, *timing));
        }
        while self.readings.len() > 2 && at.saturating_duration_since(self.readings[1].0) > WINDOW {
            self.readings.pop_front();
        }
        let Some((from, then)) = self.readings.front() else {
            return Means::default();
        };
        let seconds = at.saturating_duration_since(*from).as_secs_f64();
        let ticks = timing.ticks.saturating_sub(then.ticks) as f64;
        if seconds <= 0.0 || ticks <= 0.0 {
            return Means::default();
        }
        let mean = |now: u64, then: u64| now.saturating_sub(then) as f64 * 1e-3 / ticks;
        Means {
            rate: ticks / seconds,
            latency: mean(timing.latency, then.latency),
            lateness: mean(timing.lateness, then.lateness),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_last_second() {
        let (mut meter, began) = (RateMeter::default(), Instant::now());
        let mut timing = Timing::default();
        let mut means = Means::default();
        for k in 0..300u64 {
            // 500 ticks a second at first, then 1000; 20 µs each.
            timing.ticks += if k < 150 { 8 } else { 16 };
            timing.latency = timing.ticks * 20_000;
            timing.lateness = timing.ticks * 3000;
            means = meter.update(began + Duration::from_millis(16 * k), &timing);
            if k == 149 {
                assert!((means.rate - 500.0).abs() < 1.0, "{means:?}");
            }
        }
        assert!((means.rate - 1000.0).abs() < 1.0, "{means:?}");
        assert!((means.latency - 20.0).abs() < 1e-9 && (means.lateness - 3.0).abs() < 1e-9);
        assert!(meter.readings.len() < 25);
    }
}
