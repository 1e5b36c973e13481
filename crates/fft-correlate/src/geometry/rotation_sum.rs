//! Weighted sums over a few near rotations: what a table keeps at a rotation node.

use glam::DQuat;

use crate::geometry::half_turn::{HalfTurn, same};

/// A weighted sum of what is asked for at each of a few rotations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationSum {
    terms: [(DQuat, f64); Self::MOST],
    count: usize,
}

impl RotationSum {
    /// The largest number of rotations.
    pub const MOST: usize = 5;

    /// One rotation, as it is.
    pub fn one(rotation: DQuat) -> Self {
        Self {
            terms: [(rotation, 1.0); Self::MOST],
            count: 1,
        }
    }

    /// One rotation with weight `1 + n weight`, and `n` others with `-weight` each.
    ///
    /// # Panics
    /// If there are more than [`RotationSum::MOST`].
    pub(crate) fn less(rotation: DQuat, others: &[DQuat], weight: f64) -> Self {
        let mut sum = Self::one(rotation);
        sum.terms[0].1 += others.len() as f64 * weight;
        for other in others {
            sum.terms[sum.count] = (*other, -weight);
            sum.count += 1;
        }
        sum
    }

    /// Rotations and weights.
    pub fn terms(&self) -> &[(DQuat, f64)] {
        &self.terms[..self.count]
    }

    /// The first rotation.
    pub(crate) fn first(&self) -> DQuat {
        self.terms[0].0
    }

    /// Every rotation followed by a half turn.
    pub(crate) fn turned(mut self, turn: HalfTurn) -> Self {
        for (rotation, _) in &mut self.terms {
            *rotation = turn.rotation() * *rotation;
        }
        self
    }

    /// Whether both sum the same, in whatever order.
    pub(crate) fn agrees(&self, other: &Self) -> bool {
        let has = |(q, w): &(DQuat, f64)| {
            let found = |(p, v): &&(DQuat, f64)| same(*q, *p) && (w - v).abs() < 1e-9;
            other.terms().iter().any(|term| found(&term))
        };
        self.count == other.count && self.terms().iter().all(has)
    }
}
