//! Refining poses: downhill, distinct, measured.

use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
use crate::dock::domain::SearchDomain;
use crate::dock::error::SearchError;
use crate::dock::measure;
use crate::dock::options::SearchOptions;
use crate::dock::peaks::PoseSpacing;
use crate::dock::refine::Descent;
use crate::dock::report::FoundPose;
use crate::energy::EnergySource;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;

/// Points of the direct evaluator that descends first. With fewer, contact reaches so far that sums
/// over curved faces take longer than they save.
const FEW_POINTS: usize = 25_000;

/// Poses that descended to within this angle and two cells of each other count as one, radians.
const SAME_ANGLE: f64 = 0.07;

/// How far a descent goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Most line searches on each source.
    pub(super) steps: usize,
    /// A trial step shorter than this ends it, cells.
    pub(super) last_step: f64,
    /// How far from the pose it begins, cells: poses of a lattice may have walls exactly flush, where
    /// slopes are two-valued and lead nowhere.
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

/// Two evaluators of a pair that descend one after the other: of fewer points, standing on a coarser
/// lattice of the same smoothed densities, with contact, and of every cell.
pub(super) struct Sources {
    few: Option<DirectEvaluator>,
    full: DirectEvaluator,
}

impl Sources {
    pub(super) fn new(pair: &Pair) -> Result<Self, DirectError> {
        Ok(Self {
            few: of_points(pair, FEW_POINTS)?,
            full: DirectEvaluator::new(pair, &DirectOptions::FULL)?,
        })
    }

    /// The one of fewer points; the other where there is none.
    pub(super) fn few(&self) -> &DirectEvaluator {
        self.few.as_ref().unwrap_or(&self.full)
    }

    /// The one of every cell, whose energies rank.
    pub(super) fn full(&self) -> &DirectEvaluator {
        &self.full
    }
}

/// An evaluator of at most so many points; none where the surfaces have too many faces for a coarser
/// lattice.
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
pub(super) fn sort(poses: &mut [FoundPose]) {
    poses.sort_by(|a, b| {
        let order = a.energy.total_cmp(&b.energy);
        b.refined.cmp(&a.refined).then(order)
    });
}

/// What all descents of a search share.
pub(super) struct Refinement<'a> {
    domain: &'a SearchDomain,
    pub(super) options: &'a SearchOptions,
    /// Of the lattice whose displacements limit the search.
    window: TranslationWindow,
    pivot: DVec3,
    /// Of the moving part about the pivot, metres.
    radius: f64,
    pub(super) monitor: &'a dyn Monitor,
}

impl<'a> Refinement<'a> {
    /// `pair` gives the window and the moving part's radius.
    pub(super) fn new(
        pair: &Pair,
        domain: &'a SearchDomain,
        options: &'a SearchOptions,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, SearchError> {
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

    /// Sends every pose downhill on the sources in turn, by steps of at most a cell of `pair`; the
    /// `count` lowest distinct ones, ranked by the
    /// last source.
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
        sort(&mut poses);
        self.distinct(&poses, (SAME_ANGLE, 2.0 * h), count)
    }

    /// The poses to return, with their widths.
    pub(super) fn finish(&self, poses: Vec<FoundPose>, source: &DirectEvaluator) -> Vec<FoundPose> {
        let apart = (2.0 * SAME_ANGLE, 0.1 * self.radius);
        let mut poses = self.distinct(&poses, apart, self.options.top);
        poses.par_iter_mut().for_each(|p| {
            let scratch = &mut source.scratch();
            p.half_width = measure::half_width(source, scratch, &p.pose, p.energy, self.radius);
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
