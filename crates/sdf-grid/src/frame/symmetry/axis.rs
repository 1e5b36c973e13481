//! Symmetry axes and their orders.

use glam::{DQuat, DVec3};
use serde::Serialize;

/// The highest finite order looked for.
pub(super) const MAX_ORDER: u32 = 360;

/// How often a turn about an axis brings a part onto itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SymmetryOrder {
    /// Every turn by a multiple of `2 pi / n` does, n = 2 .. 360, and none between.
    Finite(u32),
    /// Every turn does, within the tolerance.
    Continuous,
}

/// An axis about which a part can be turned onto itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SymmetryAxis {
    /// The part's centroid, metres.
    pub point: DVec3,
    /// Unit vector along the axis; as detected, its largest component is positive.
    pub direction: DVec3,
    /// How often a turn brings the part onto itself.
    pub order: SymmetryOrder,
}

impl SymmetryAxis {
    /// The axis of a part that is moved by `p -> rotation * p + translation`.
    #[must_use]
    pub fn moved(&self, rotation: DQuat, translation: DVec3) -> Self {
        Self {
            point: rotation * self.point + translation,
            direction: rotation * self.direction,
            order: self.order,
        }
    }
}
