//! The two parts of a pair.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One of the two parts of a pair.
///
/// ```
/// use fft_correlate::Side;
///
/// assert_eq!(Side::Fixed.other(), Side::Moving);
/// assert_eq!(Side::Moving.to_string(), "moving");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The part that stays, whose frame poses map into.
    Fixed,
    /// The part that moves.
    Moving,
}

impl Side {
    /// The other part.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Fixed => Self::Moving,
            Self::Moving => Self::Fixed,
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fixed => "fixed",
            Self::Moving => "moving",
        })
    }
}
