//! A session's setup, and what a page may request besides frames.

use std::sync::Arc;

use fft_correlate::{EnergySource, Pose};
use haptic::{Geometry, GuidedJoint, HapticConfig, TimedPath, Workspace};
use serde_json::Value;

/// What a page may request of a session besides frames; called by the serving threads while the
/// loop runs.
pub trait Content: Send + Sync {
    /// What the page needs to know, as JSON; `docs/play.md` lists its keys.
    fn description(&self) -> Value;

    /// The bytes called `name` (`mesh/0`, `slice/1`, `skeleton/0`, ...), or `None` if there is no
    /// such thing.
    fn bytes(&self, name: &str) -> Option<Vec<u8>>;

    /// Looks for poses in which the moving part fits, best first, as a JSON list; may take minutes.
    ///
    /// # Errors
    /// In words, why there are none.
    fn dock(&self) -> Result<Value, String>;
}

/// Nothing but the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoContent;

impl Content for NoContent {
    fn description(&self) -> Value {
        Value::Null
    }

    fn bytes(&self, _: &str) -> Option<Vec<u8>> {
        None
    }

    fn dock(&self) -> Result<Value, String> {
        Err("there is nothing to look for".to_owned())
    }
}

/// What the loop runs on, and what pages can see of it.
pub struct PlaySession<'a> {
    /// Energy at poses of the moving part in the scene.
    pub source: &'a dyn EnergySource,
    /// Settings of the loop.
    pub config: HapticConfig,
    /// Where the hand's workspace lies.
    pub workspace: Workspace,
    /// Where the fit is and how one gets there.
    pub geometry: Geometry,
    /// Where the hand holds the part at first.
    pub start: Pose,
    /// The insertion path that the hand can follow, if one is known.
    pub path: Option<TimedPath>,
    /// A joint whose free motions the part follows, in all places that are alike.
    pub joints: Vec<GuidedJoint>,
    /// What a page may ask.
    pub content: Arc<dyn Content>,
}
