//! Progress of long computations, told to the worker.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use sdf_grid::Monitor;
#[cfg(target_family = "wasm")]
use wasm_bindgen::prelude::wasm_bindgen;

#[cfg(target_family = "wasm")]
#[wasm_bindgen]
unsafe extern "C" {
    /// The worker's: a stage, and the share of it that is done.
    #[wasm_bindgen(js_namespace = globalThis, js_name = pegfitProgress)]
    fn show(stage: &str, share: f64);
}

/// Outside a browser nobody looks.
#[cfg(not(target_family = "wasm"))]
fn show(_: &str, _: f64) {}

/// Tells the worker how far a computation is; never cancels: a worker that is not wanted is ended.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    stage: Mutex<String>,
    done: AtomicU64,
    total: AtomicU64,
}

impl Monitor for Progress {
    fn begin(&self, stage: &str, total: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = stage.to_owned();
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
        show(stage, 0.0);
    }

    fn advance(&self, steps: u64) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        let total = self.total.load(Ordering::Relaxed).max(1);
        let stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        show(&stage, done as f64 / total as f64);
    }
}
