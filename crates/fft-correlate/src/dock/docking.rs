//! Docking from two parts to ranked poses: frame, lattices, fields, search, and what is told of the
//! poses found.

use std::path::PathBuf;
use std::time::Instant;

use glam::{DQuat, DVec3};
use sdf_grid::{Aabb, ContactError, MatingLimits, Monitor, TriangleMesh, minimum_box_rotation};

use crate::correlate::{CorrelatorPlan, PairSupport};
use crate::dock::decide::decide;
use crate::dock::docking_error::DockingError;
use crate::dock::domain::{SearchDomain, SearchPairs};
use crate::dock::lattices::{SearchLattices, domain_rotations};
use crate::dock::options::SearchOptions;
use crate::dock::plan::DockingPlan;
use crate::dock::report::FoundPose;
use crate::dock::report::SearchStage;
use crate::dock::rotations::symmetry_group;
use crate::dock::search::search;
use crate::dock::sketch::wants_sketch;
use crate::dock::told::{DockingPose, mating_areas, told};
use crate::dock::weights::docking_weights;
use crate::geometry::se3::Pose;
use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan};
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;
use crate::rotations::domain::{RotationDomain, RotationError};
use crate::rotations::symmetry::symmetry_on_lattice;
use crate::setup::pair_setup::PairSetup;

/// Angle between rotations where no domain is given, degrees.
const STEP_DEG: f64 = 15.0;

/// Faces that turn from being opposite by more than this do not mate, radians: 10 degrees.
pub const MATING_ANGLE: f64 = 0.1745;

/// Width of the pieces of the moving part's surface whose mating is asked, fine spacings.
const MATING_PIECES: f64 = 0.5;

/// What is asked of docking.
#[derive(Debug, Clone, PartialEq)]
pub struct DockingOptions {
    /// Distinct poses to return, at most.
    pub top: usize,
    /// Score every rotation on the coarse lattice, without a sketch to choose among them.
    pub exhaustive: bool,
    /// Rotations of the moving part, fixed part's frame; all of them, 15 degrees apart, if absent.
    pub rotations: Option<RotationDomain>,
    /// Faces at most this far apart count as mating ([`DockingPose::mating_area`]), metres; the fine
    /// spacing if absent.
    pub mating_clearance: Option<f64>,
    /// File in which scored rotations are kept, and found again by a later run.
    pub state: Option<PathBuf>,
}

impl Default for DockingOptions {
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
pub struct DockingReport {
    /// Distinct poses, lowest energy first; those that could not be refined last.
    pub poses: Vec<DockingPose>,
    /// The lattices it worked on.
    pub lattices: SearchLattices,
    /// Motions that map the moving part onto itself: poses that differ by one count as the same.
    pub symmetries: Vec<Pose>,
    /// Rotations looked at.
    pub rotations: usize,
    /// Of these, rotations that the sketch chose; all without one.
    pub chosen: usize,
    /// Of the chosen, rotations scored; fewer if the monitor cancelled.
    pub scored: usize,
    /// Of the scored, those that the state file already held.
    pub resumed: usize,
    /// Translations scored per rotation, along x, y, z.
    pub window: [usize; 3],
    /// Points of the transforms.
    pub transform_size: [usize; 3],
    /// The model that ranked the poses.
    pub model: ScoreModel,
    /// Poses that the fine lattice could not tell from the deepest, that one included.
    pub close: usize,
    /// Why these were not decided on a finer lattice, if they should have been.
    pub undecided: Option<PairBuildError>,
    /// Why poses were ranked by cell averages instead of smoothed densities and contact, if they
    /// were: faces too many to be summed over.
    pub averaged: Option<ContactError>,
    /// Wall time of the density fields, seconds.
    pub field_seconds: f64,
    /// The other stages, in order.
    pub stages: Vec<SearchStage>,
    /// Wall time per rotation scored, seconds, without the sketch.
    pub seconds_per_rotation: f64,
}

impl DockingReport {
    /// Wall time of all stages but the fields, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}

/// Where does the moving part belong? Two parts, turned into a frame that suits the search.
///
/// The fixed part is turned so that it fills its box along the axes: lattices and transforms become
/// smaller. A setup that gives a box of displacements is looked at in its own frame. The moving part
/// stays as it is: with lattices that lie parallel, errors at touching faces add up
/// (`docs/docking.md`).
#[derive(Debug, Clone)]
pub struct Docking<'a> {
    setup: &'a PairSetup,
    options: DockingOptions,
    /// From the fixed part's own frame to that of the search.
    frame: Pose,
    /// The fixed part in the latter; none if it stays.
    turned: Option<TriangleMesh>,
    lattices: SearchLattices,
}

/// The pairs of a search, at the scale of the setup.
struct Fields {
    sketch: Option<Pair>,
    coarse: Pair,
    fine: Pair,
    /// Under the setup's own halo, if that is not the search's.
    own: Option<Pair>,
    gamma: f64,
    /// Why the fine pair is of cell averages, if it had to be.
    averaged: Option<ContactError>,
    /// Wall time they took.
    seconds: f64,
}

impl<'a> Docking<'a> {
    /// A search for poses of a setup's moving part: in its box of displacements if it gives one, else
    /// wherever the parts can touch. A spacing or halo that the setup gives is kept for the fine
    /// lattice.
    pub fn new(setup: &'a PairSetup, options: DockingOptions) -> Self {
        let rotation = match setup.half_extent {
            Some(_) => DQuat::IDENTITY,
            None => minimum_box_rotation(&setup.fixed),
        };
        let turned =
            (rotation != DQuat::IDENTITY).then(|| setup.fixed.transformed(rotation, DVec3::ZERO));
        let mut lattices = SearchLattices::new(&setup.moving);
        if let Some(spacing) = setup.builder.spacing {
            lattices.fine = spacing;
            lattices.coarse = lattices.coarse.max(spacing);
            lattices.sketch = lattices.sketch.max(2.0 * spacing);
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

    /// Computes the fields, searches, and looks closer at the poses found. With a state file, what a
    /// cancelled run has scored is not lost. When the monitor cancels after rotations have been
    /// scored, the best of these are returned unrefined.
    ///
    /// # Errors
    /// If the domain, the model or the memory limit does not allow the search, a part has no interior
    /// on a lattice, the state file is unusable or of another search, or the monitor cancels before
    /// any rotation is scored.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<DockingReport, DockingError> {
        self.require_clearance()?;
        let domain = self.domain()?;
        let plan = self.planned(&domain)?;
        self.require_memory(&plan)?;
        tracing::debug!(%plan, "docking");
        let Fields {
            sketch,
            coarse,
            fine: mut finest,
            own,
            gamma,
            averaged,
            seconds: mut field_seconds,
        } = self.fields(&plan, monitor)?;
        let options = self.search_options();
        let pairs = SearchPairs {
            sketch: sketch.as_ref(),
            coarse: &coarse,
            fine: &finest,
        };
        let state = self.options.state.as_deref();
        let mut found = search(&pairs, &domain, &options, state, monitor)?;
        let close = found.close();
        let mut undecided = None;
        if close > 1 && !monitor.cancelled() {
            let began = Instant::now();
            let finer = self.deciding().and_then(|plan| self.build(&plan, monitor));
            field_seconds += began.elapsed().as_secs_f64();
            match finer {
                Ok(finer) => {
                    finest = finer.with_gamma(gamma)?;
                    decide(&mut found, &finest, &domain, &options, monitor)?;
                }
                Err(reason) => undecided = Some(reason),
            }
        }
        let mating = self.mating_areas(&found.poses)?;
        let pairs = [&finest, own.as_ref().unwrap_or(&finest)];
        let solids = [self.fixed(), &self.setup.moving];
        let poses = told(&found, pairs, solids, &mating, &self.frame.inverse())?;
        Ok(DockingReport {
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
        // Whether half turns will share their work depends on the rotations that a sketch chooses.
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

    /// The pairs of the plan, the sketch's if there are enough rotations for one.
    fn fields(&self, plan: &DockingPlan, monitor: &dyn Monitor) -> Result<Fields, DockingError> {
        let [sketch, coarse, fine] = &plan.pairs;
        let began = Instant::now();
        let (fine, averaged) = self.ranking(fine, monitor)?;
        let own = match (&plan.own, &averaged) {
            (None, _) => None,
            (Some(own), None) => Some(self.build(own, monitor)?),
            (Some(_), Some(_)) => {
                let plan = self.own_plan(&self.averages())?;
                Some(self.build(&plan, monitor)?)
            }
        };
        let gamma = self.setup.gamma()?;
        let coarse = self.build(coarse, monitor)?.with_gamma(gamma)?;
        let sketch = match !self.options.exhaustive && wants_sketch(plan.rotations) {
            true => Some(self.build(sketch, monitor)?.with_gamma(gamma)?),
            false => None,
        };
        Ok(Fields {
            sketch,
            coarse,
            fine: fine.with_gamma(gamma)?,
            own: own.map(|own| own.with_gamma(gamma)).transpose()?,
            gamma,
            averaged,
            seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// The pair by which poses are ranked: of cell averages where the surfaces cannot be summed over.
    fn ranking(
        &self,
        plan: &PairPlan,
        monitor: &dyn Monitor,
    ) -> Result<(Pair, Option<ContactError>), PairBuildError> {
        let setup = self.setup;
        match self.build(plan, monitor) {
            Err(PairBuildError::Contact(reason)) => {
                let builder = self.averages();
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

    /// The pair on half the fine spacing.
    fn deciding(&self) -> Result<PairPlan, PairBuildError> {
        let setup = self.setup;
        self.lattices
            .deciding_plan(self.fixed(), &setup.moving, &setup.model, &setup.builder)
    }

    /// The setup's pair on the fine lattice, with as long a halo as it chooses itself.
    fn own_plan(&self, builder: &PairBuilder) -> Result<PairPlan, PairBuildError> {
        let builder = PairBuilder {
            spacing: Some(self.lattices.fine),
            ..*builder
        };
        builder.plan(self.fixed(), &self.setup.moving, &self.setup.model)
    }

    /// How pairs are built whose surfaces cannot be summed over.
    fn averages(&self) -> PairBuilder {
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

    /// Refuses a clearance of mating faces that is none.
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

#[cfg(test)]
#[path = "docking_tests.rs"]
mod tests;
