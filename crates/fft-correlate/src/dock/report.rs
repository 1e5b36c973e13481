//! What a search returns.

use serde::Serialize;

use crate::geometry::se3::Pose;
use crate::pair::model::ScoreModel;

/// Energies on the fine lattice differ by about 1 % of the depth with where its nodes happen to lie
/// in the parts (`docs/docking.md`); poses within this share of the depth are not told apart by it.
pub const CLOSE: f64 = 0.03;

/// One pose found by a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundPose {
    /// Where the moving part is.
    pub pose: Pose,
    /// Energy there under the docking weights, joules; 0 far away.
    pub energy: f64,
    /// False if downhill led out of the domain (or the monitor cancelled): the pose is then where
    /// it was before that stage.
    pub refined: bool,
    /// How far along the axis on which the energy rises fastest it rises to half, metres; none if
    /// it does not within the moving part's radius.
    pub half_width: Option<f64>,
    /// Index of the rotation from which it was reached, in the domain's.
    pub rotation: usize,
    /// Energy of the lattice pose from which it was reached, joules, coarse lattice.
    pub lattice_energy: f64,
}

/// The stage that scores rotations.
pub(super) const SCORING: &str = "scoring";

/// What one stage did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchStage {
    /// `sketch`, `scoring`, `coarse descent`, `fine descent`, `decision`.
    pub name: &'static str,
    /// Rotations scored or poses refined.
    pub items: usize,
    /// Wall time, seconds; scoring counts what a resumed search did before.
    pub seconds: f64,
}

/// What a search found and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchReport {
    /// Distinct poses, lowest energy first; those that could not be refined last.
    pub poses: Vec<FoundPose>,
    /// Rotations scored; fewer than chosen if the monitor cancelled.
    pub scored: usize,
    /// Rotations that the sketch chose; all of the domain's without one.
    pub chosen: usize,
    /// Rotations of the domain.
    pub rotations: usize,
    /// Of the scored, those that a state file already held.
    pub resumed: usize,
    /// Translations scored per rotation, along x, y, z.
    pub window: [usize; 3],
    /// Points of the transforms.
    pub transform_size: [usize; 3],
    /// The model that ranked the poses.
    pub model: ScoreModel,
    /// The stages, in order.
    pub stages: Vec<SearchStage>,
}

impl SearchReport {
    /// How many of the poses, from the first on, are within [`CLOSE`] of the deepest: two or more
    /// are too close for the fine lattice to tell apart ([`super::decide`]).
    pub fn close(&self) -> usize {
        let deepest = self.poses.first().map_or(0.0, |p| p.energy);
        let near = |p: &&FoundPose| p.refined && p.energy < (1.0 - CLOSE) * deepest;
        self.poses.iter().take_while(near).count()
    }

    /// Wall time per rotation scored, seconds, without the sketch.
    pub fn seconds_per_rotation(&self) -> f64 {
        let scoring = self.stages.iter().find(|s| s.name == SCORING);
        scoring.map_or(0.0, |s| s.seconds) / self.scored.max(1) as f64
    }

    /// Wall time of all stages, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}
