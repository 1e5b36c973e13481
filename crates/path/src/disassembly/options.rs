//! What a disassembly may be asked.

use std::time::Duration;

use crate::planner::options::{PathOptions, Start};

/// What a disassembly may be asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisassemblyOptions {
    /// Overlaps up to this depth count as contact, metres; a thousandth of the radius of what is moved
    /// if absent.
    pub tolerance: Option<f64>,
    /// Largest motion of any point between two poses of a way, metres; a thirtieth of the radius if
    /// absent.
    pub step: Option<f64>,
    /// One try of a part or group gives up after this time.
    pub time_limit: Duration,
    /// Go on if parts overlap where they are assembled: overlaps as deep as that then count as contact.
    pub allow_overlap: bool,
    /// At most so many parts are moved together, 1 or more. That no two sets of parts come apart is
    /// known only if it is half their number.
    pub largest_group: usize,
}

impl Default for DisassemblyOptions {
    /// A minute a try, groups of three.
    fn default() -> Self {
        Self {
            tolerance: None,
            step: None,
            time_limit: Duration::from_secs(60),
            allow_overlap: false,
            largest_group: 3,
        }
    }
}

impl DisassemblyOptions {
    /// What is asked of each way, which may take so long.
    pub(super) fn of_a_way(&self, time_limit: Duration) -> PathOptions {
        PathOptions {
            tolerance: self.tolerance,
            step: self.step,
            time_limit,
            start: Start::Outside,
            allow_overlap: self.allow_overlap,
            others: 0.0,
        }
    }
}
