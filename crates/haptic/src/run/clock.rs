//! The two clocks of a loop.

use serde::Serialize;

/// Whose seconds count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The wall clock, one tick per period.
    Real,
    /// A count of periods, without waiting: the same inputs give the same forces on any machine.
    Simulated,
}
