//! What is told of the poses that a search found.

use rayon::prelude::*;
use sdf_grid::{Interference, InterferenceQuery, MatingLimits, MatingSurfaces, TriangleMesh};

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
    /// Pose in the fixed part's own frame, energy under the docking weights, and width.
    pub found: FoundPose,
    /// Energy as a share of the deepest pose's; 0 if none is below zero.
    pub depth: f64,
    /// How good the fit is, 0 to 1: the score under the setup's model as a share of what the smaller
    /// part would score in a perfect mould of itself ([`Pair::mould_score`]).
    pub quality: f64,
    /// How far the solids lie in one another, measured from their surfaces.
    pub interference: Interference,
    /// Share of the moving part's volume that the fixed part fills as well, 0 ..= 1.
    pub overlap: f64,
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
    [fixed, moving]: [&TriangleMesh; 2],
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
    let perfect = own.mould_score();
    let query = InterferenceQuery::new(fixed, moving);
    let volume = moving.volume();
    let deepest = report.poses.iter().map(|p| p.energy).fold(0.0, f64::min);
    let told = |(index, p): (usize, &FoundPose)| {
        let model_energy = source.evaluate_full(&p.pose).response.energy;
        let interference = query.at(p.pose.rotation, p.pose.translation);
        DockingPose {
            found: FoundPose {
                pose: *back * p.pose,
                ..*p
            },
            depth: if deepest < 0.0 {
                p.energy / deepest
            } else {
                0.0
            },
            quality: (-model_energy / (own.model().gamma * perfect)).clamp(0.0, 1.0),
            overlap: (interference.volume / volume).clamp(0.0, 1.0),
            interference,
            mating_area: mating[index],
            model_energy,
            condition: conditions.get(index).copied(),
        }
    };
    let poses: Vec<_> = report.poses.iter().enumerate().collect();
    Ok(poses.into_par_iter().map(told).collect())
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
