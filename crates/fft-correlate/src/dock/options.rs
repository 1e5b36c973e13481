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
    /// Share of the rotations that goes on from the sketch, 0 ..= 1.
    pub chosen_share: f64,
    /// Distinct poses that descend on the coarse lattice.
    pub coarse_poses: usize,
    /// Distinct poses that descend on the fine lattice; at least `top`.
    pub fine_poses: usize,
    /// Interior weight over exterior weight; [`crate::dock::DOCKING_RATIO`] unless there is a
    /// reason.
    pub ratio: f64,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            top: 10,
            per_rotation: 4,
            chosen_share: 0.15,
            coarse_poses: 100,
            fine_poses: 16,
            ratio: DOCKING_RATIO,
        }
    }
}
