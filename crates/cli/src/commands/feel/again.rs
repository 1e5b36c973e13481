//! Whether a replay gave the recorded forces.

use haptic::Sample;
use serde::Serialize;

/// How the wrenches of a replay compare with the recorded ones, bit by bit.
#[derive(Debug, Serialize)]
pub(super) struct Again {
    /// Ticks compared.
    ticks: usize,
    /// Ticks with another force or torque.
    different: usize,
    /// The first of these, as the log counts.
    first_different: Option<u64>,
}

impl Again {
    pub(super) fn compare(recorded: &[Sample], samples: &[Sample]) -> Self {
        let pairs = || recorded.iter().zip(samples);
        let other = |(a, b): &(&Sample, &Sample)| bits(a) != bits(b);
        Self {
            ticks: pairs().count(),
            different: pairs().filter(other).count(),
            first_different: pairs().find(other).map(|(recorded, _)| recorded.tick),
        }
    }

    pub(super) fn print(&self) {
        match self.first_different {
            None => crate::say!(
                "replay      all {} forces are the recorded ones, bit by bit",
                self.ticks
            ),
            Some(tick) => crate::say!(
                "replay      {} of {} forces are not the recorded ones, from tick {tick} on: \
                 another scene, source, setting or device, or a log that began in the middle of a \
                 run",
                self.different,
                self.ticks
            ),
        }
    }
}

fn bits(sample: &Sample) -> [[u64; 3]; 2] {
    [sample.wrench.torque, sample.wrench.force].map(|v| v.to_array().map(f64::to_bits))
}
