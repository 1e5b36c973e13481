//! The result of a path search.

use fft_correlate::{Pose, Response};
use serde::Serialize;

use crate::motion::describe::Motion;

/// A path from outside (or a given pose) to the goal, with its measures. Poses and motions are
/// those of the shapes, in the fixed part's own frame.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::Pose;
/// use pegfit_path::{Outcome, PathRequest, PathSearch};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(2e-4)?;
/// let request = PathRequest { others: 0.0, ..PathRequest::default() };
/// let search = PathSearch::new(Arc::new(hole), Arc::new(peg), request)?;
/// let result = search.find(&Pose::IDENTITY, None, &Silent)?;
/// assert!(result.outcome == Outcome::Free && result.is_free());
/// // Along the hole, which is 30 mm deep; depths and lengths are metres.
/// assert!(result.length() > 0.03 && result.deepest().1 <= result.tolerance);
/// let (first, last) = (result.poses[0], result.poses[result.poses.len() - 1]);
/// assert!(first.length == 0.0 && last.pose == Pose::IDENTITY);
/// assert!(result.others.is_empty() && result.effort.points > 1000);
/// assert!(result.turn() < 0.1 && result.barrier.is_none());
/// // The way back begins where the parts fit.
/// assert_eq!(result.reversed().poses[0].pose, Pose::IDENTITY);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PathResult {
    /// Whether the path is free.
    pub outcome: Outcome,
    /// From the start to the goal, at equal steps; empty if nothing was found at any level.
    pub poses: Vec<PathPose>,
    /// Largest motion of any point of the part from one pose to the next, metres.
    pub step: f64,
    /// Overlaps up to this depth count as contact, metres.
    pub tolerance: f64,
    /// The highest climb, if energies were asked for.
    pub barrier: Option<EnergyBarrier>,
    /// Energy out of reach less that of the goal, joules, if energies were asked for.
    pub depth: Option<f64>,
    /// Volume that the solids share where they overlap deepest, cubic metres.
    pub volume: f64,
    /// Description of the path, without short motions.
    pub motions: Vec<Motion>,
    /// Paths that leave in other directions, searched for as long as the first one took; none has an energy
    /// barrier lower by more than a hundredth of the depth.
    pub others: Vec<OtherPath>,
    /// Cost of the search.
    pub effort: Effort,
}

/// Whether a part reaches the goal.
///
/// See the example of [`PathResult`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// At the points of the search the solids never overlap by more than the tolerance; whether denser
    /// ones agree says [`PathResult::is_free`].
    Free,
    /// The parts have to overlap; the path is that of least overlap.
    Blocked {
        /// With overlaps up to this depth a path was found, metres; none if at no depth tried.
        passed_at: Option<f64>,
        /// With overlaps up to this depth none was found, metres.
        stuck_at: f64,
        /// Whether everything was tried at the tolerance (at the step of the search), or it is proven
        /// that there is no path; else time ran out.
        exhausted: bool,
        /// Whether it is proven, whatever the part does: a ball inside of it does not come out with
        /// overlaps up to the tolerance.
        proven: bool,
    },
}

/// A pose along a path.
///
/// See the example of [`PathResult`].
#[derive(Debug, Clone, Copy)]
pub struct PathPose {
    /// Of the shapes.
    pub pose: Pose,
    /// Path length of the farthest-going point since the start, metres.
    pub length: f64,
    /// Penetration depth: of the deepest point of either part in the other, metres.
    pub depth: f64,
    /// Energy and wrench on the part, if they were asked for.
    pub response: Option<Response>,
}

/// Another path.
///
/// See the example of [`PathResult`].
#[derive(Debug, Clone)]
pub struct OtherPath {
    /// Path length of the farthest-going point, metres.
    pub length: f64,
    /// Description of the path, inwards.
    pub motions: Vec<Motion>,
    /// The highest climb along it, if energies were asked for.
    pub barrier: Option<EnergyBarrier>,
}

/// Cost of a search.
///
/// See the example of [`PathResult`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Effort {
    /// Poses from which directions were tried.
    pub nodes: usize,
    /// Poses at which collisions were checked.
    #[serde(rename = "poses_looked_at")]
    pub poses_checked: usize,
    /// Poses reached where the part had been: the search does not continue from them.
    #[serde(rename = "places_passed_over")]
    pub duplicates: usize,
    /// Points of both surfaces at which distances are taken.
    #[serde(rename = "surface_points")]
    pub points: usize,
    /// Longest motion of any point between two poses of the search, metres.
    pub step: f64,
    /// Time of the search, seconds.
    pub search_seconds: f64,
    /// Time of shortening, smoothing and measuring, seconds.
    pub finish_seconds: f64,
}

impl PathResult {
    /// The largest overlap along the path, metres, and at which pose.
    pub fn deepest(&self) -> (usize, f64) {
        let depths = self.poses.iter().map(|p| p.depth).enumerate();
        let deepest = depths.max_by(|a, b| a.1.total_cmp(&b.1));
        deepest.unwrap_or((0, 0.0))
    }

    /// Whether a path was found and no overlap measured along it is deeper than the tolerance.
    pub fn is_free(&self) -> bool {
        self.outcome == Outcome::Free && self.deepest().1 <= self.tolerance
    }

    /// How much the part turns in all, radians.
    pub fn turn(&self) -> f64 {
        let steps = self.poses.windows(2);
        steps.map(|w| w[0].pose.angle_to(&w[1].pose)).sum()
    }

    /// The same path from the goal to the start; without energies and other paths.
    pub fn reversed(mut self) -> Self {
        let whole = self.length();
        self.poses.reverse();
        for pose in &mut self.poses {
            pose.length = whole - pose.length;
        }
        self.motions = self.motions.iter().rev().map(Motion::reversed).collect();
        self
    }

    /// Path length of the farthest-going point, metres.
    pub fn length(&self) -> f64 {
        self.poses.last().map_or(0.0, |p| p.length)
    }
}

/// The energy barrier of a path: the highest climb.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::{DirectEvaluator, DirectOptions, PairBuilder, Pose, ScoreModel};
/// use pegfit_path::{PathRequest, PathSearch};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(2e-4)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// let request = PathRequest { others: 0.0, ..PathRequest::default() };
/// let search = PathSearch::new(Arc::new(hole), Arc::new(peg), request)?;
/// let result = search.find(&Pose::IDENTITY, Some(&source), &Silent)?;
/// // The energy falls nearly all the way into the fit: joules, and shares of the depth.
/// let (barrier, depth) = (result.barrier.expect("energies"), result.depth.expect("energies"));
/// assert!(depth > 0.0 && (barrier.share - barrier.energy / depth).abs() < 1e-9);
/// assert!(barrier.share < 0.05 && barrier.top < result.poses.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EnergyBarrier {
    /// From a pose to a later one, joules; 0 if the energy never rises.
    pub energy: f64,
    /// The same as a share of the depth of the fit below the energy out of reach.
    pub share: f64,
    /// At which pose it ends.
    pub top: usize,
}

/// The highest climb from first to last, of a well that is `depth` joules deep.
pub(crate) fn energy_barrier(energies: &[f64], depth: f64) -> EnergyBarrier {
    let mut lowest = f64::INFINITY;
    let mut best = EnergyBarrier {
        energy: 0.0,
        share: 0.0,
        top: 0,
    };
    for (i, energy) in energies.iter().enumerate() {
        lowest = lowest.min(*energy);
        if energy - lowest > best.energy {
            best.energy = energy - lowest;
            best.top = i;
        }
    }
    best.share = if depth > 0.0 {
        best.energy / depth
    } else {
        0.0
    };
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_climb_is_from_a_low_to_a_later_high() {
        let barrier = energy_barrier(&[0.0, -1.0, 0.5, -3.0, -2.0, -4.0], 4.0);
        assert_eq!(
            (barrier.energy, barrier.share, barrier.top),
            (1.5, 0.375, 2)
        );
        assert_eq!(energy_barrier(&[0.0, -1.0, -2.0], 2.0).energy, 0.0);
    }
}
