//! What a computation tells the thread that waits for it, and hears from it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use sdf_grid::Monitor;

/// Progress of one computation and its order to stop; shared by all of its threads.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    stop: AtomicBool,
    done: AtomicU64,
    stage: Mutex<(String, u64)>,
}

/// How far a computation is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Progress {
    pub(super) stage: String,
    pub(super) done: u64,
    pub(super) total: u64,
}

impl Watch {
    pub(super) fn stop(&self) {
        self.stop.store(true, Relaxed);
    }

    /// The flag itself, for loops that watch one.
    pub(crate) fn flag(&self) -> &AtomicBool {
        &self.stop
    }

    pub(super) fn progress(&self) -> Progress {
        let stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        Progress {
            stage: stage.0.clone(),
            done: self.done.load(Relaxed).min(stage.1),
            total: stage.1,
        }
    }
}

impl Monitor for Watch {
    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Relaxed);
    }

    fn begin(&self, stage: &str, total: u64) {
        let mut current = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        *current = (stage.to_owned(), total);
        self.done.store(0, Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.stop.load(Relaxed)
    }
}
