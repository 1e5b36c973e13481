//! Docking from two parts to ranked poses: frame, lattices, fields, search, and the report of each
//! pose.

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use sdf_grid::{
    Aabb, ContactError, Interference, InterferenceQuery, MatingLimits, MatingSurfaces, Monitor,
    TriangleMesh, minimum_box_rotation,
};

use crate::correlate::{CorrelatorPlan, PairSupport};
use crate::direct::condition::Condition;
use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::dock::error::DockingError;
use crate::dock::grid_levels::{GridLevels, domain_rotations};
use crate::dock::local_refinement::{FoundPose, SearchResult, SearchStage};
use crate::dock::options::{SearchDomain, SearchOptions, SearchPairs, docking_weights};
use crate::dock::rotations::symmetry_group;
use crate::dock::search::{needs_screening, rerank, search};
use crate::geometry::se3::Pose;
use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan};
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;
use crate::pair::setup::PairSetup;
use crate::rotations::domain::{RotationDomain, RotationError};
use crate::rotations::symmetry::symmetry_on_lattice;

/// Angle between rotations where no domain is given, degrees.
const STEP_DEG: f64 = 15.0;

/// Faces that turn from being opposite by more than this do not mate, radians: 10 degrees.
pub const MATING_ANGLE: f64 = 0.1745;

/// Width of the pieces of the moving part's surface whose mating area is measured, fine spacings.
const MATING_PIECES: f64 = 0.5;

/// The options of a docking run.
#[derive(Debug, Clone, PartialEq)]
pub struct DockingRequest {
    /// Distinct poses to return, at most.
    pub top: usize,
    /// Score every rotation on the coarse lattice, without screening.
    pub exhaustive: bool,
    /// Rotations of the moving part, fixed part's frame; all of them, 15 degrees apart, if absent.
    pub rotations: Option<RotationDomain>,
    /// Faces at most this far apart count as mating ([`DockingPose::mating_area`]), metres; by
    /// default the fine spacing.
    pub mating_clearance: Option<f64>,
    /// File that keeps the scored rotations, from which a later run goes on.
    pub state: Option<PathBuf>,
}

impl Default for DockingRequest {
    /// Ten poses, everywhere, without a state file.
    fn default() -> Self {
        Self {
            top: 10,
            exhaustive: false,
            rotations: None,
            mating_clearance: None,
            state: None,
        }
    }
}

/// What docking found and what it cost.
#[derive(Debug)]
pub struct DockingResult {
    /// Distinct poses, lowest energy first; those that could not be refined last.
    pub poses: Vec<DockingPose>,
    /// The lattices it worked on.
    pub lattices: GridLevels,
    /// Motions that map the moving part onto itself: poses that differ by one count as the same.
    pub symmetries: Vec<Pose>,
    /// Rotations of the domain.
    pub rotations: usize,
    /// Rotations that the screening chose; all without one.
    pub chosen: usize,
    /// Chosen rotations that were scored; fewer if the monitor cancelled.
    pub scored: usize,
    /// Scored rotations that the state file already held.
    pub resumed: usize,
    /// Translations scored per rotation, along x, y, z.
    pub window: [usize; 3],
    /// Points of the transforms.
    pub transform_size: [usize; 3],
    /// The model that ranked the poses.
    pub model: ScoreModel,
    /// Poses within [`CLOSE`](super::CLOSE) of the deepest on the fine lattice, the deepest included.
    pub close: usize,
    /// Why close poses were not ranked anew on a finer lattice, if they should have been.
    pub undecided: Option<PairBuildError>,
    /// Why poses were ranked by cell averages instead of smoothed densities and contact: the parts
    /// have too many faces for the contact sum.
    pub averaged: Option<ContactError>,
    /// Wall time of the density fields, seconds.
    pub field_seconds: f64,
    /// The other stages, in order.
    pub stages: Vec<SearchStage>,
    /// Wall time per rotation scored, seconds, without the screening.
    pub seconds_per_rotation: f64,
}

impl DockingResult {
    /// Wall time of all stages but the fields, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}

/// A search for the poses in which two parts fit.
///
/// The fixed part is turned so that it fills its box along the axes: lattices and transforms become
/// smaller. With a box of displacements in the setup it keeps its own frame. The moving part is not
/// turned: on parallel lattices errors at touching faces add up (`docs/docking.md`).
#[derive(Debug, Clone)]
pub struct Docking<'a> {
    setup: &'a PairSetup,
    options: DockingRequest,
    /// From the fixed part's own frame to that of the search.
    frame: Pose,
    /// The fixed part in the frame of the search; none if it is its own.
    turned: Option<TriangleMesh>,
    lattices: GridLevels,
}

/// The pairs of a search, at the scale of the setup.
struct Fields {
    screening: Option<Pair>,
    coarse: Pair,
    fine: Pair,
    /// Under the setup's own halo, if that is not the search's.
    own: Option<Pair>,
    gamma: f64,
    /// Why the fine pair has cell averages instead of smoothed densities.
    averaged: Option<ContactError>,
    /// Wall time they took.
    seconds: f64,
}

impl<'a> Docking<'a> {
    /// A search for poses of a setup's moving part: in its box of displacements if it gives one, else
    /// wherever the parts can touch. A spacing or halo that the setup gives is kept for the fine
    /// lattice.
    pub fn new(setup: &'a PairSetup, options: DockingRequest) -> Self {
        let rotation = match setup.half_extent {
            Some(_) => DQuat::IDENTITY,
            None => minimum_box_rotation(&setup.fixed),
        };
        let turned =
            (rotation != DQuat::IDENTITY).then(|| setup.fixed.transformed(rotation, DVec3::ZERO));
        let mut lattices = GridLevels::new(&setup.moving);
        if let Some(spacing) = setup.builder.spacing {
            lattices.fine = spacing;
            lattices.coarse = lattices.coarse.max(spacing);
            lattices.screening = lattices.screening.max(2.0 * spacing);
        }
        if let Some(halo) = setup.builder.halo {
            lattices.halo = halo;
        }
        Self {
            setup,
            options,
            frame: Pose::new(rotation, DVec3::ZERO),
            turned,
            lattices,
        }
    }

    /// Computes the fields, searches, and reports the poses found. A state file keeps the scores of
    /// a cancelled run. When the monitor cancels after rotations have been scored, the best of these
    /// are returned unrefined.
    ///
    /// # Errors
    /// If the domain, the model or the memory limit does not allow the search, a part has no interior
    /// on a lattice, the state file is unusable or of another search, or the monitor cancels before
    /// any rotation is scored.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<DockingResult, DockingError> {
        self.require_clearance()?;
        let domain = self.domain()?;
        let plan = self.planned(&domain)?;
        self.require_memory(&plan)?;
        tracing::debug!(%plan, "docking");
        let Fields {
            screening,
            coarse,
            fine: mut finest,
            own,
            gamma,
            averaged,
            seconds: mut field_seconds,
        } = self.fields(&plan, monitor)?;
        let options = self.search_options();
        let pairs = SearchPairs {
            screening: screening.as_ref(),
            coarse: &coarse,
            fine: &finest,
        };
        // Search; rank close poses anew on a finer lattice.
        let state = self.options.state.as_deref();
        let mut found = search(&pairs, &domain, &options, state, monitor)?;
        let close = found.close();
        let mut undecided = None;
        if close > 1 && !monitor.cancelled() {
            let began = Instant::now();
            let finer = self
                .rerank_plan()
                .and_then(|plan| self.build(&plan, monitor));
            field_seconds += began.elapsed().as_secs_f64();
            match finer {
                Ok(finer) => {
                    finest = finer.with_gamma(gamma)?;
                    rerank(&mut found, &finest, &domain, &options, monitor)?;
                }
                Err(reason) => undecided = Some(reason),
            }
        }
        // Report the poses in the fixed part's own frame.
        let mating = self.mating_areas(&found.poses)?;
        let pairs = [&finest, own.as_ref().unwrap_or(&finest)];
        let solids = [self.fixed(), &self.setup.moving];
        let poses = pose_reports(&found, pairs, solids, &mating, &self.frame.inverse())?;
        Ok(DockingResult {
            poses,
            lattices: self.lattices,
            symmetries: domain.symmetries,
            rotations: found.rotations,
            chosen: found.chosen,
            scored: found.scored,
            resumed: found.resumed,
            window: found.window,
            transform_size: found.transform_size,
            model: found.model,
            close,
            undecided,
            averaged,
            field_seconds,
            seconds_per_rotation: found.seconds_per_rotation(),
            stages: found.stages,
        })
    }

    /// What [`Docking::run`] will do and need, with the threads of the current rayon pool; nothing of
    /// its size is allocated.
    ///
    /// # Errors
    /// If the domain or the model does not allow the search, or the fields would exceed the setup's
    /// memory limit.
    pub fn plan(&self) -> Result<DockingPlan, DockingError> {
        self.planned(&self.domain()?)
    }

    fn planned(&self, domain: &SearchDomain) -> Result<DockingPlan, DockingError> {
        let (setup, fixed) = (self.setup, self.fixed());
        let pairs = self
            .lattices
            .plans(fixed, &setup.moving, &setup.model, &setup.builder)?;
        let [_, coarse, _] = &pairs;
        let weighed = PairPlan {
            model: docking_weights(&coarse.model, self.search_options().ratio),
            ..coarse.clone()
        };
        let support = PairSupport::planned(&weighed, fixed, &setup.moving);
        let window = domain.window(coarse.pivot, coarse.spacing())?;
        // Whether half turns will share their work depends on the rotations that a screening chooses.
        let scores = CorrelatorPlan::largest(&support, &window, rayon::current_num_threads())?;
        let own = match setup.builder.halo {
            Some(_) => None,
            None => Some(self.own_plan(&setup.builder)?),
        };
        Ok(DockingPlan {
            rotations: domain.rotations.len(),
            scores,
            pairs,
            own,
        })
    }

    /// The pairs of the plan, the screening's if there are enough rotations for one.
    fn fields(&self, plan: &DockingPlan, monitor: &dyn Monitor) -> Result<Fields, DockingError> {
        let [screening, coarse, fine] = &plan.pairs;
        let began = Instant::now();
        let (fine, averaged) = self.ranking_pair(fine, monitor)?;
        let own = match (&plan.own, &averaged) {
            (None, _) => None,
            (Some(own), None) => Some(self.build(own, monitor)?),
            (Some(_), Some(_)) => {
                let plan = self.own_plan(&self.averaging_builder())?;
                Some(self.build(&plan, monitor)?)
            }
        };
        let gamma = self.setup.gamma()?;
        let coarse = self.build(coarse, monitor)?.with_gamma(gamma)?;
        let screening = match !self.options.exhaustive && needs_screening(plan.rotations) {
            true => Some(self.build(screening, monitor)?.with_gamma(gamma)?),
            false => None,
        };
        Ok(Fields {
            screening,
            coarse,
            fine: fine.with_gamma(gamma)?,
            own: own.map(|own| own.with_gamma(gamma)).transpose()?,
            gamma,
            averaged,
            seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// The pair that ranks poses: with cell averages where the parts have too many faces for the
    /// contact sum.
    fn ranking_pair(
        &self,
        plan: &PairPlan,
        monitor: &dyn Monitor,
    ) -> Result<(Pair, Option<ContactError>), PairBuildError> {
        let setup = self.setup;
        match self.build(plan, monitor) {
            Err(PairBuildError::Contact(reason)) => {
                let builder = self.averaging_builder();
                let [_, _, plan] =
                    (self.lattices).plans(self.fixed(), &setup.moving, &setup.model, &builder)?;
                Ok((self.build(&plan, monitor)?, Some(reason)))
            }
            other => Ok((other?, None)),
        }
    }

    /// The fixed part in the frame of the search.
    fn fixed(&self) -> &TriangleMesh {
        self.turned.as_ref().unwrap_or(&self.setup.fixed)
    }

    fn build(&self, plan: &PairPlan, monitor: &dyn Monitor) -> Result<Pair, PairBuildError> {
        let cache = self.setup.cache.as_ref();
        plan.build(self.fixed(), &self.setup.moving, cache, monitor)
    }

    /// The pair by which close poses are ranked anew: on half the fine spacing, with eight times its
    /// memory and time.
    fn rerank_plan(&self) -> Result<PairPlan, PairBuildError> {
        let (setup, spacing) = (self.setup, 0.5 * self.lattices.fine);
        (self.lattices).plan(
            spacing,
            self.fixed(),
            &setup.moving,
            &setup.model,
            &setup.builder,
        )
    }

    /// The setup's pair on the fine lattice, with as long a halo as it chooses itself.
    fn own_plan(&self, builder: &PairBuilder) -> Result<PairPlan, PairBuildError> {
        let builder = PairBuilder {
            spacing: Some(self.lattices.fine),
            ..*builder
        };
        builder.plan(self.fixed(), &self.setup.moving, &self.setup.model)
    }

    /// Options for pairs with too many faces for the contact sum.
    fn averaging_builder(&self) -> PairBuilder {
        PairBuilder {
            smoothing: None,
            ..self.setup.builder
        }
    }

    fn search_options(&self) -> SearchOptions {
        let top = self.options.top;
        SearchOptions {
            top,
            coarse_poses: (20 * top).max(1500),
            fine_poses: (6 * top / 5).max(12),
            ..SearchOptions::default()
        }
    }

    /// Where to look, in the frame of the search.
    fn domain(&self) -> Result<SearchDomain, RotationError> {
        let axes = symmetry_on_lattice(&self.setup.moving, self.lattices.fine);
        let everywhere = RotationDomain::full(STEP_DEG);
        let domain = self.options.rotations.as_ref().unwrap_or(&everywhere);
        let (mut rotations, step) = domain_rotations(domain, &axes)?;
        // All of them lie evenly in this frame already, where most work is shared.
        if !matches!(domain, RotationDomain::Full { .. }) {
            for rotation in &mut rotations {
                *rotation = self.frame.rotation * *rotation;
            }
        }
        Ok(SearchDomain {
            rotations,
            step,
            places: self.places(),
            symmetries: symmetry_group(&axes),
        })
    }

    /// Where the pivot may be, in the frame of the search.
    fn places(&self) -> Aabb {
        let setup = self.setup;
        match setup.half_extent {
            Some(half) => {
                let middle = setup.center + setup.assembled.apply(self.lattices.pivot);
                Aabb {
                    min: middle - half,
                    max: middle + half,
                }
            }
            None => self.lattices.places(&self.fixed().bounds()),
        }
    }

    /// Refuses a clearance of mating faces that is negative or not finite.
    fn require_clearance(&self) -> Result<(), DockingError> {
        match self.options.mating_clearance {
            Some(found) if !(found.is_finite() && found >= 0.0) => {
                Err(DockingError::MatingClearance { found })
            }
            _ => Ok(()),
        }
    }

    /// Refuses a window whose correlation might not fit in memory.
    fn require_memory(&self, plan: &DockingPlan) -> Result<(), DockingError> {
        let needed = plan.scoring_bytes(rayon::current_num_threads());
        match self.setup.builder.memory_limit {
            Some(limit) if needed > limit => Err(DockingError::Memory { needed, limit }),
            _ => Ok(()),
        }
    }

    /// The mating area of each pose, square metres.
    fn mating_areas(&self, poses: &[FoundPose]) -> Result<Vec<f64>, PairBuildError> {
        let fine = self.lattices.fine;
        let limits = MatingLimits {
            clearance: self.options.mating_clearance.unwrap_or(fine),
            angle: MATING_ANGLE,
        };
        let parts = [self.fixed(), &self.setup.moving];
        mating_areas(poses, parts, &limits, MATING_PIECES * fine)
    }
}

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
    /// ([`MATING_ANGLE`], [`crate::DockingRequest::mating_clearance`]), square metres.
    pub mating_area: f64,
    /// Energy under the setup's own model and halo, on the fine lattice, joules: what an evaluator of
    /// the setup's pair gives at this pose, up to the error of the lattice.
    pub model_energy: f64,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses only.
    pub condition: Option<f64>,
}

/// The reports of a search's poses. `back` leads from the frame of the search to the fixed part's
/// own; `mating` is the mating area of each pose, square metres.
pub(super) fn pose_reports(
    report: &SearchResult,
    [finest, own]: [&Pair; 2],
    [fixed, moving]: [&TriangleMesh; 2],
    mating: &[f64],
    back: &Pose,
) -> Result<Vec<DockingPose>, DockingError> {
    let ranking_pair = finest.with_model(report.model)?;
    let conditions: Vec<f64> = report
        .poses
        .par_iter()
        .take(CONDITION_POSES)
        .map(|p| Condition::at(&ranking_pair, &p.pose).number())
        .collect();
    let source = DirectEvaluator::new(own, &DirectOptions::FULL)?;
    let perfect = own.mould_score();
    let query = InterferenceQuery::new(fixed, moving);
    let volume = moving.volume();
    let deepest = report.poses.iter().map(|p| p.energy).fold(0.0, f64::min);
    let report_of = |(index, p): (usize, &FoundPose)| {
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
    Ok(poses.into_par_iter().map(report_of).collect())
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

/// The lattices, rotations, memory and time of a docking run, known before any field is computed.
#[derive(Debug, Clone, PartialEq)]
pub struct DockingPlan {
    /// The pairs of a search: screening (unused for few rotations), coarse, fine.
    pub pairs: [PairPlan; 3],
    /// The pair under the setup's own halo, on the fine lattice, whose energies are reported; absent
    /// where the halo of the search is the setup's.
    pub own: Option<PairPlan>,
    /// Rotations of the domain.
    pub rotations: usize,
    /// The scores on the coarse lattice: sizes, memory and time, those of the computed pair at most.
    pub scores: CorrelatorPlan,
}

impl DockingPlan {
    /// Bytes that scoring with this many threads takes at most.
    pub fn scoring_bytes(&self, threads: usize) -> u64 {
        self.scores.bytes(threads)
    }

    /// Bytes of the fields that are held at once.
    pub fn field_bytes(&self) -> u64 {
        self.pairs
            .iter()
            .chain(&self.own)
            .map(|pair| pair.bytes)
            .sum()
    }
}

impl fmt::Display for DockingPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, pair) in ["sketch", "coarse", "fine"].iter().zip(&self.pairs) {
            write!(f, "{name}: {pair}; ")?;
        }
        if let Some(own) = &self.own {
            write!(f, "own halo: {own}; ")?;
        }
        write!(f, "at most {} rotations x {}", self.rotations, self.scores)
    }
}

#[cfg(test)]
#[path = "docking_tests.rs"]
mod tests;
