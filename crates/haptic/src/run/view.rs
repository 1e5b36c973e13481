//! What another thread sees of a running loop.

use std::time::Instant;

use crate::path::sample::{Sample, flags};
use crate::run::pace::Spent;

/// Ticks over which the worst times are kept.
const BLOCK: u64 = 1000;

/// The newest sample and what was counted up to it, so that who looks seldom misses nothing.
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
    pub(crate) fn count(&mut self, spent: &Spent) {
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
            timing.count(&Spent {
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
