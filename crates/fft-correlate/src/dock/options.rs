//! How a search proceeds.

use serde::{Deserialize, Serialize};

use crate::dock::weights::DOCKING_RATIO;

/// How a search proceeds. The default suits parts of a few hundred cells' volume and more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchOptions {
    /// Poses to return, at most.
    pub top: usize,
    /// Local maxima kept of each rotation.
    pub per_rotation: usize,
    /// Share of the rotations that goes on from the sketch at least, 0 ..= 1.
    pub chosen_share: f64,
    /// Distinct poses that begin to descend on the coarse lattice, at most.
    pub coarse_poses: usize,
    /// Rotations whose best energy, as sketched, and poses whose energy, as scored, is shallower than
    /// the lowest by up to this share of it go on: what cell averages may hide of a fit. 0 ..= 1.
    pub blur: f64,
    /// Distinct poses that descend on the fine lattice; at least `top`.
    pub fine_poses: usize,
    /// Interior weight over exterior weight; [`crate::dock::DOCKING_RATIO`] unless there is a
    /// reason.
    pub ratio: f64,
}

impl SearchOptions {
    /// Distinct poses that go on from the first steps of their descent on the coarse lattice.
    pub(super) fn going_on(&self) -> usize {
        4 * self.fine_poses.max(self.top)
    }
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            top: 10,
            per_rotation: 4,
            chosen_share: 0.15,
            coarse_poses: 1500,
            blur: 0.35,
            fine_poses: 12,
            ratio: DOCKING_RATIO,
        }
    }
}
