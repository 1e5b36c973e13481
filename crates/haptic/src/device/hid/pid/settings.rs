//! What a user may say of a PID device.

use serde::{Deserialize, Serialize};

/// What a descriptor cannot say: the table `pid` of a scene's `[device]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PidSettings {
    /// Force of the full magnitude at the handle, N, > 0. Default 5. A force of the loop becomes
    /// the magnitude `force / max_force`; stated too low, the device pushes harder than the log
    /// says.
    pub max_force: f64,
    /// Edge of the workspace that the full range of the axes stands for, metres, > 0. Default 0.2.
    pub workspace: f64,
    /// Stiffest wall, N/m, at `rate`, > 0. Default 500.
    pub max_stiffness: f64,
    /// Reports per second the device takes, > 0. Default 500.
    pub rate: f64,
    /// Device gain, 0 ..= 1. Default 1: less makes full magnitude weaker than `max_force`.
    pub gain: f64,
    /// +1 or -1 per axis x, y, z: which way a positive magnitude pushes. Default +1.
    pub signs: [f64; 3],
}

impl Default for PidSettings {
    fn default() -> Self {
        Self {
            max_force: 5.0,
            workspace: 0.2,
            max_stiffness: 500.0,
            rate: 500.0,
            gain: 1.0,
            signs: [1.0; 3],
        }
    }
}
