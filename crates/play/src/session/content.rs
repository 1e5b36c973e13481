//! A session's setup, and what a page may request besides frames.

use std::sync::Arc;

use fft_correlate::{EnergySource, Pose};
use haptic::{
    Geometry, GuidedJoint, HapticConfig, OperatorConfig, RemoteCommand, RemoteControl,
    RemoteDevice, TimedPath, Workspace,
};
use serde_json::{Value, json};

/// Greatest force and torque of the page's hand as shares of the loop's limits: a hand that is
/// as strong as what the loop may show would go through every wall.
const STRENGTH: f64 = 0.6;

/// The page's hand weighs nothing but itself, kg, and is damped accordingly, N·s/m: it keeps up
/// with a mouse.
const LIGHT: (f64, f64) = (0.1, 8.0);

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

/// What a page is told after a search for poses.
pub(crate) fn docked(content: &dyn Content) -> Value {
    match content.dock() {
        Ok(poses) => json!({ "docked": poses }),
        Err(why) => json!({ "docked": [], "failed": why }),
    }
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

impl PlaySession<'_> {
    /// The page's hand, which holds nothing yet, and its control.
    pub(crate) fn hand(&self) -> (RemoteDevice, RemoteControl) {
        let hand = OperatorConfig {
            mass: LIGHT.0,
            damping: LIGHT.1,
            strength: STRENGTH * self.config.limits.force,
            rotational_strength: STRENGTH * self.config.limits.torque,
            // The scripts go on until somebody does something else.
            duration: 1e6,
            ..OperatorConfig::default()
        };
        let times = self.config.times();
        let (hand, mut remote) =
            RemoteDevice::new(hand, self.geometry, self.workspace, &self.start, times);
        // One command, so that the part is where it is shown from the first frame on.
        remote.command(RemoteCommand::LetGo);
        (hand, remote)
    }
}
