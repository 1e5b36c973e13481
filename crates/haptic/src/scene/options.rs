//! How a scene is kept in memory.

use std::time::Duration;

use glam::DVec3;

/// How a scene is kept in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// Point of the moving part as placed (metres, what poses move) that reaches speak of.
    pub pivot: DVec3,
    /// Most bytes that loaded pairs may take together.
    pub memory: u64,
    /// Pairs whose reach is nearer than this to the pivot are loaded ahead, metres.
    pub ahead: f64,
    /// Rotations of a table that the part can reach by turning no farther than this, radians, are
    /// loaded before the loop starts, and make no room for a pair that is not yet in reach.
    pub turn_ahead: f64,
    /// Time between two looks at the files.
    pub watch: Duration,
}

impl Default for SceneOptions {
    /// The part's origin, no limit, 20 mm and 10 degrees ahead, files twice a second.
    fn default() -> Self {
        Self {
            pivot: DVec3::ZERO,
            memory: u64::MAX,
            ahead: 0.02,
            turn_ahead: 10f64.to_radians(),
            watch: Duration::from_millis(500),
        }
    }
}
