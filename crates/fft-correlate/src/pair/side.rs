//! Which of a pair's parts.

/// One of the two parts of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The part that stays.
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
