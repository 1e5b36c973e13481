//! One bake of a table at a time in a process.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;

/// Tables that this process is baking.
static BAKING: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Between two looks whether a table is still being baked.
const PAUSE: Duration = Duration::from_millis(5);

/// A table is being baked as long as this lives.
pub(super) struct Claim(PathBuf);

impl Claim {
    /// Waits while this process bakes the table already: of a bake that was interrupted, what it had
    /// begun may still end in the background. Waits on the calling thread, which computes nothing.
    pub(super) fn wait(py: Python<'_>, path: &Path) -> PyResult<Self> {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let baking = || BAKING.lock().unwrap_or_else(PoisonError::into_inner);
        while !baking().insert(path.clone()) {
            py.check_signals()?;
            py.detach(|| std::thread::sleep(PAUSE));
        }
        Ok(Self(path))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut baking = BAKING.lock().unwrap_or_else(PoisonError::into_inner);
        baking.remove(&self.0);
    }
}
