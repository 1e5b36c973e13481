//! What happens to the pairs of a scene while the loop runs.

use web_time::Instant;

/// Something that happened to a pair while the loop ran.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneEvent {
    /// When.
    pub at: Instant,
    /// The pair's name.
    pub pair: String,
    /// What.
    pub what: SceneChange,
}

/// What can happen to a pair.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneChange {
    /// It came near and was loaded.
    Loaded {
        /// Time it took.
        seconds: f64,
        /// Memory it takes; nothing if it shares what another pair has loaded.
        bytes: u64,
    },
    /// It changed and was loaded again.
    Reloaded {
        /// Time it took.
        seconds: f64,
        /// Memory it takes; nothing if it shares what another pair has loaded.
        bytes: u64,
    },
    /// It made room for a nearer pair.
    Unloaded,
    /// The table of a pair that came near was opened, or opened again because it changed: its
    /// rotations are loaded as the part comes near them.
    Opened {
        /// Rotations of the whole table.
        rotations: usize,
        /// Memory that each takes, bytes.
        each: u64,
    },
    /// All rotations of its table are in memory.
    Complete {
        /// Memory that they take.
        bytes: u64,
    },
    /// It, or rotations of its table, could not be loaded; what was loaded before stays. It is
    /// tried again when its files change or a reload is asked for.
    Failed(String),
    /// It, or rotations of its table that are needed, are near but do not fit into the budget
    /// beside what is in reach.
    NoRoom {
        /// Bytes it needs.
        needed: u64,
        /// Bytes that could be made free.
        free: u64,
    },
}

/// What a pair is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairState {
    /// Far away, or not yet loaded.
    Waiting,
    /// Loaded and asked where it is in reach.
    Loaded,
    /// Asked where it is in reach and the rotations that matter are in memory.
    Partly {
        /// Rotations in memory.
        rotations: usize,
        /// Rotations of the whole table.
        of: usize,
    },
    /// Could not be loaded.
    Failed,
    /// Does not fit into the budget.
    NoRoom,
}
