//! What the loop runs on.

use std::sync::Arc;

use fft_correlate::{EnergySource, Pose};
use haptic::{Geometry, HapticConfig, Way, Workspace};

use crate::stage::exhibits::Exhibits;

/// What the loop runs on, and what pages are shown of it.
pub struct Stage<'a> {
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
    /// The way in that the hand can follow, if one is known.
    pub way: Option<Way>,
    /// What a page may ask.
    pub exhibits: Arc<dyn Exhibits>,
}
