//! Local refinement of poses: descent, removal of duplicates, width of the well.

use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::Monitor;
use serde::Serialize;

use crate::direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
use crate::dock::error::DockingError;
use crate::dock::options::{SearchDomain, SearchOptions};
use crate::dock::refine::Descent;
use crate::energy::{EnergySource, Scratch};
use crate::geometry::pose_spacing::PoseSpacing;
use crate::geometry::se3::Pose;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;

/// Points of the direct evaluator that descends first. With fewer, contact reaches so far that sums
/// over curved faces take longer than they save.
const COARSE_POINTS: usize = 25_000;

/// Poses that descended to within this angle and two cells of each other count as one, radians.
const SAME_ANGLE: f64 = 0.07;

/// How far a descent goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Most line searches on each source.
    pub(super) steps: usize,
    /// A trial step shorter than this ends it, cells.
    pub(super) last_step: f64,
    /// Distance from the pose to the start, cells: at a pose of a lattice walls may be exactly
    /// flush, where slopes are two-valued and lead nowhere.
    pub(super) nudge: f64,
}

impl Effort {
    /// Until it is clear which poses will become deep.
    pub(super) const FIRST: Self = Self {
        steps: 5,
        last_step: 0.05,
        nudge: 0.1,
    };
    /// Into the basin in which a finer lattice goes on.
    pub(super) const COARSE: Self = Self {
        steps: 16,
        last_step: 0.05,
        nudge: 0.0,
    };
    /// To the bottom.
    pub(super) const FINE: Self = Self {
        steps: 60,
        last_step: 5e-3,
        nudge: 0.0,
    };
}

/// Two evaluators of a pair, used one after the other: one with fewer points, on a coarser lattice
/// of the same smoothed densities, with contact, and one with every cell.
pub(super) struct Evaluators {
    coarse: Option<DirectEvaluator>,
    full: DirectEvaluator,
}

impl Evaluators {
    pub(super) fn new(pair: &Pair) -> Result<Self, DirectError> {
        Ok(Self {
            coarse: of_points(pair, COARSE_POINTS)?,
            full: DirectEvaluator::new(pair, &DirectOptions::FULL)?,
        })
    }

    /// The evaluator with fewer points; the full one where there is none.
    pub(super) fn coarse(&self) -> &DirectEvaluator {
        self.coarse.as_ref().unwrap_or(&self.full)
    }

    /// The evaluator with every cell, whose energies rank poses.
    pub(super) fn full(&self) -> &DirectEvaluator {
        &self.full
    }
}

/// An evaluator with at most `most` points; none where the surfaces have too many faces for a
/// coarser lattice.
fn of_points(pair: &Pair, most: usize) -> Result<Option<DirectEvaluator>, DirectError> {
    let options = DirectOptions {
        max_points: Some(most),
        ..DirectOptions::REAL_TIME
    };
    match DirectEvaluator::new(pair, &options) {
        Err(DirectError::Coarser(reason)) => {
            tracing::debug!(%reason, most, "no evaluator of few points");
            Ok(None)
        }
        other => other.map(Some),
    }
}

/// Refined poses first, the lowest energy first among each: energies of different lattices differ a
/// little.
pub(super) fn sort_poses(poses: &mut [FoundPose]) {
    poses.sort_by(|a, b| {
        let order = a.energy.total_cmp(&b.energy);
        b.refined.cmp(&a.refined).then(order)
    });
}

/// What all descents of a search share.
pub(super) struct LocalRefinement<'a> {
    domain: &'a SearchDomain,
    pub(super) options: &'a SearchOptions,
    /// Of the lattice whose displacements limit the search.
    window: TranslationWindow,
    pivot: DVec3,
    /// Of the moving part about the pivot, metres.
    radius: f64,
    pub(super) monitor: &'a dyn Monitor,
}

impl<'a> LocalRefinement<'a> {
    /// `pair` gives the window and the moving part's radius.
    pub(super) fn new(
        pair: &Pair,
        domain: &'a SearchDomain,
        options: &'a SearchOptions,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, DockingError> {
        Ok(Self {
            domain,
            options,
            window: domain.window(pair.pivot(), pair.spacing())?,
            pivot: pair.pivot(),
            radius: radius_about_pivot(pair),
            monitor,
        })
    }

    /// At most `count` poses farther apart than an angle (radians) and a distance, in order.
    pub(super) fn distinct(
        &self,
        poses: &[FoundPose],
        apart: (f64, f64),
        count: usize,
    ) -> Vec<FoundPose> {
        let spacing = PoseSpacing {
            angle: apart.0,
            distance: apart.1,
            pivot: self.pivot,
            symmetries: self.domain.symmetries.clone(),
        };
        let kept = spacing.distinct(poses.iter().map(|p| &p.pose), count);
        kept.into_iter().map(|i| poses[i]).collect()
    }

    /// Minimizes the energy from every pose, on the sources in turn, by steps of at most a cell of
    /// `pair`. Returns the `count` lowest distinct poses, ranked by the last source.
    pub(super) fn descend(
        &self,
        mut poses: Vec<FoundPose>,
        pair: &Pair,
        sources: &[&DirectEvaluator],
        effort: Effort,
        count: usize,
    ) -> Vec<FoundPose> {
        let h = pair.spacing();
        let descent = Descent {
            pivot: self.pivot,
            radius: self.radius,
            first_step: h,
            last_step: effort.last_step * h,
            max_steps: effort.steps,
        };
        poses.par_iter_mut().for_each(|p| {
            if self.monitor.cancelled() {
                p.refined = false;
                return;
            }
            let (mut pose, mut energy) = (descent.nudged(&p.pose, effort.nudge * h), p.energy);
            for source in sources {
                (pose, energy) = descent.run(*source, &pose);
            }
            // Downhill may lead out of the domain: then the pose at its edge stays.
            p.refined = covers(&self.window, pair.displacement(&pose));
            if p.refined {
                (p.pose, p.energy) = (pose, energy);
            }
            self.monitor.advance(1);
        });
        sort_poses(&mut poses);
        self.distinct(&poses, (SAME_ANGLE, 2.0 * h), count)
    }

    /// The poses to return, with their widths.
    pub(super) fn finish(&self, poses: Vec<FoundPose>, source: &DirectEvaluator) -> Vec<FoundPose> {
        let apart = (2.0 * SAME_ANGLE, 0.1 * self.radius);
        let mut poses = self.distinct(&poses, apart, self.options.top);
        poses.par_iter_mut().for_each(|p| {
            let scratch = &mut source.scratch();
            p.half_width = half_width(source, scratch, &p.pose, p.energy, self.radius);
        });
        poses
    }
}

/// Largest distance of the moving part's interior nodes from the pivot, metres; at least one
/// lattice spacing.
fn radius_about_pivot(pair: &Pair) -> f64 {
    let field = pair.moving();
    let distance = |((i, j, k), d): ((usize, usize, usize), &f32)| {
        (*d <= 0.0).then(|| (field.lattice().position([i, j, k]) - pair.pivot()).length())
    };
    field
        .signed_distance
        .indexed_iter()
        .filter_map(distance)
        .fold(pair.spacing(), f64::max)
}

/// Whether a displacement lies within half a cell of the window's nodes.
fn covers(window: &TranslationWindow, displacement: DVec3) -> bool {
    let bounds = window.lattice().node_bounds();
    bounds
        .grown(0.5 * window.lattice().spacing())
        .contains(displacement)
}

/// How far from `pose`, along the axis of the fixed frame on which the energy rises fastest, it
/// rises to half, metres, without rotation; none if it does not within `reach`. Resolved to a
/// hundredth of the reach.
pub(super) fn half_width(
    source: &dyn EnergySource,
    scratch: &mut Scratch,
    pose: &Pose,
    energy: f64,
    reach: f64,
) -> Option<f64> {
    const STEPS: usize = 100;
    let directions = [DVec3::X, DVec3::Y, DVec3::Z];
    (1..=STEPS)
        .map(|i| reach * i as f64 / STEPS as f64)
        .find(|&s| {
            directions.iter().any(|d| {
                [s, -s].into_iter().any(|s| {
                    let moved = Pose {
                        translation: pose.translation + *d * s,
                        ..*pose
                    };
                    source.evaluate(&moved, scratch).energy >= 0.5 * energy
                })
            })
        })
}

/// Energies on the fine lattice differ by about 1 % of the depth with where its nodes happen to lie
/// in the parts (`docs/docking.md`); it cannot distinguish poses within this share of the depth.
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

/// The work and time of one stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchStage {
    /// `sketch`, `scoring`, `coarse descent`, `fine descent`, `decision`.
    pub name: &'static str,
    /// Rotations scored or poses refined.
    pub items: usize,
    /// Wall time, seconds; scoring counts what a resumed search did before.
    pub seconds: f64,
}

/// The poses and the cost of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// Distinct poses, lowest energy first; those that could not be refined last.
    pub poses: Vec<FoundPose>,
    /// Rotations scored; fewer than chosen if the monitor cancelled.
    pub scored: usize,
    /// Rotations that the screening chose; all of the domain's without one.
    pub chosen: usize,
    /// Rotations of the domain.
    pub rotations: usize,
    /// Scored rotations that a state file already held.
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

impl SearchResult {
    /// How many of the poses, from the first on, are within [`CLOSE`] of the deepest: two or more
    /// are too close for the fine lattice to tell apart (`rerank`).
    pub fn close(&self) -> usize {
        let deepest = self.poses.first().map_or(0.0, |p| p.energy);
        let near = |p: &&FoundPose| p.refined && p.energy < (1.0 - CLOSE) * deepest;
        self.poses.iter().take_while(near).count()
    }

    /// Wall time per rotation scored, seconds, without the screening.
    pub fn seconds_per_rotation(&self) -> f64 {
        let scoring = self.stages.iter().find(|s| s.name == SCORING);
        scoring.map_or(0.0, |s| s.seconds) / self.scored.max(1) as f64
    }

    /// Wall time of all stages, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::Response;

    #[test]
    fn width_of_a_known_well() {
        struct Cone;
        impl EnergySource for Cone {
            fn scratch(&self) -> Scratch {
                Scratch::default()
            }
            fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
                let t = pose.translation * DVec3::new(1.0, 4.0, 2.0);
                Response {
                    energy: -(1.0 - t.length()).max(0.0),
                    ..Response::default()
                }
            }
        }
        let width =
            |reach| half_width(&Cone, &mut Scratch::default(), &Pose::IDENTITY, -1.0, reach);
        assert!((width(1.0).unwrap() - 0.125).abs() < 0.011);
        assert_eq!(width(0.1), None);
    }
}
