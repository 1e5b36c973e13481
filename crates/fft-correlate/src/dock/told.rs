//! What is told of the poses that a search found.

use rayon::prelude::*;
use sdf_grid::{MatingLimits, MatingSurfaces, TriangleMesh};

use crate::direct::condition::Condition;
use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::dock::error::SearchError;
use crate::dock::report::{FoundPose, SearchReport};
use crate::geometry::se3::Pose;
use crate::pair::builder::PairBuildError;
use crate::pair::fields::Pair;

/// How many of the best poses have the condition number of their score found, cell by cell.
const CONDITION_POSES: usize = 16;

/// One pose found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DockingPose {
    /// Pose in the fixed part's own frame, energy under the docking weights, width and overlap.
    pub found: FoundPose,
    /// Energy as a share of the deepest pose's; 0 if none is below zero.
    pub depth: f64,
    /// Area of the moving part's faces that lie against opposite faces of the fixed part
    /// ([`crate::MATING_ANGLE`], [`crate::DockingOptions::mating_clearance`]), square metres.
    pub mating_area: f64,
    /// Energy under the setup's own model and halo, on the fine lattice, joules: what an evaluator of
    /// the setup's pair says at this pose, up to the error of the lattice.
    pub model_energy: f64,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses only.
    pub condition: Option<f64>,
}

/// The poses of a search, `back` from its frame to the fixed part's own, with what only the finest
/// pair, the setup's own pair and the faces of both parts can tell.
pub(super) fn told(
    report: &SearchReport,
    [finest, own]: [&Pair; 2],
    mating: &[f64],
    back: &Pose,
) -> Result<Vec<DockingPose>, SearchError> {
    let ranking = finest.with_model(report.model)?;
    let conditions: Vec<f64> = report
        .poses
        .par_iter()
        .take(CONDITION_POSES)
        .map(|p| Condition::at(&ranking, &p.pose).number())
        .collect();
    let source = DirectEvaluator::new(own, &DirectOptions::FULL)?;
    let deepest = report.poses.iter().map(|p| p.energy).fold(0.0, f64::min);
    let told = |(index, p): (usize, &FoundPose)| DockingPose {
        found: FoundPose {
            pose: *back * p.pose,
            ..*p
        },
        depth: if deepest < 0.0 {
            p.energy / deepest
        } else {
            0.0
        },
        mating_area: mating[index],
        model_energy: source.evaluate_full(&p.pose).response.energy,
        condition: conditions.get(index).copied(),
    };
    Ok(report.poses.iter().enumerate().map(told).collect())
}

/// The mating area of each pose, square metres; the moving part in pieces `distance` wide, metres.
pub(super) fn mating_areas(
    poses: &[FoundPose],
    [fixed, moving]: [&TriangleMesh; 2],
    limits: &MatingLimits,
    distance: f64,
) -> Result<Vec<f64>, PairBuildError> {
    let surfaces = MatingSurfaces::new(fixed, moving, distance)?;
    let area = |p: &FoundPose| surfaces.area(p.pose.rotation, p.pose.translation, limits);
    Ok(poses.par_iter().map(area).collect())
}
