//! How MuJoCo is asked to compile a model.

use std::path::PathBuf;
use std::time::Duration;

/// How MuJoCo is asked to compile a model.
#[derive(Debug, Clone, PartialEq)]
pub struct MujocoOptions {
    /// A Python interpreter that may have the module `mujoco`: a path, or a name on the PATH. If
    /// `None`, the first of `python3` and `python` that has it. Without the module, a model is read
    /// only if it needs nothing of MuJoCo.
    pub interpreter: Option<PathBuf>,
    /// Processor time after which MuJoCo is stopped, in whole seconds, at least one; by the clock it
    /// may take ten times as long.
    pub time_limit: Duration,
    /// Address space that it may use, and the most it may write to a file, bytes.
    pub memory_limit: u64,
}

impl Default for MujocoOptions {
    /// An interpreter from the PATH, 2 minutes, 4 GiB.
    fn default() -> Self {
        Self {
            interpreter: None,
            time_limit: Duration::from_secs(120),
            memory_limit: 4 << 30,
        }
    }
}
