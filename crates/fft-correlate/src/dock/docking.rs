//! Docking from two parts to ranked poses: frame, lattices, fields, search, and the report of each
//! pose.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;
use web_time::Instant;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use sdf_grid::{Aabb, ContactError, Interference, Monitor, TriangleMesh, minimum_box_rotation};

use crate::correlate::{CorrelatorPlan, PairSupport};
use crate::direct::condition::Condition;
use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::dock::error::DockingError;
use crate::dock::grid_levels::{GridLevels, domain_rotations};
use crate::dock::local_refinement::{FoundPose, SearchResult, SearchStage};
use crate::dock::options::{
    DockingPlan, SearchDomain, SearchOptions, SearchPairs, docking_weights, with_docking_weights,
};
use crate::dock::search::{needs_screening, rerank, search};
use crate::geometry::se3::Pose;
use crate::mating::{HeldPose, HoldReport, Joint, MatingSearch, MatingSearchOptions, SearchRegion};
use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan};
use crate::pair::fields::{FieldNodes, Pair};
use crate::pair::model::ScoreModel;
use crate::pair::setup::PairSetup;
use crate::rotations::domain::{RotationDomain, RotationError};
use crate::rotations::search_rotations::symmetry_group;
use crate::rotations::symmetry::symmetry_on_lattice;

/// Angle between rotations where no domain is given, degrees.
const STEP_DEG: f64 = 15.0;

/// From this rank on poses need no search by energy, nats: a part on a face or in a corner has less.
pub const CONVINCING: f64 = 8.0;

/// Energies that are only reported are of a lattice this much wider than the pair's own, unless the
/// scene states its spacing, and wider still where the fields would need more bytes than these.
const ENERGY_SPACING: f64 = 1.7;
const ENERGY_BYTES: u64 = 1 << 29;

/// The options of a docking run. See the example of [`dock`](crate::dock).
#[derive(Debug, Clone, PartialEq)]
pub struct DockingRequest {
    /// Distinct poses to return, at most.
    pub top: usize,
    /// Score every rotation on the coarse lattice, without screening.
    pub exhaustive: bool,
    /// Rotations of the moving part, fixed part's frame; all of them, 15 degrees apart, if absent.
    pub rotations: Option<RotationDomain>,
    /// Faces at most this far apart count as mating, metres; by default 4 % of the moving part's root
    /// mean square radius.
    pub mating_clearance: Option<f64>,
    /// File that keeps the scored rotations of a search by energy, from which a later run goes on.
    pub state: Option<PathBuf>,
    /// What ranks the poses.
    pub ranking: Ranking,
    /// By contact: only poses near this one, fixed part's frame: the moving part's middle at most so
    /// far away (metres), turned by at most an angle (radians).
    pub near: Option<(Pose, f64, f64)>,
    /// By contact: an axis about which the moving part turns and along which it slides, and no other
    /// way: a point, metres, and a direction, fixed part's frame.
    pub axis: Option<(DVec3, DVec3)>,
    /// By contact: parts that are there, in the fixed part's frame: the moving one does not overlap them.
    pub others: Vec<Arc<TriangleMesh>>,
    /// No search by energy, which takes far longer, where contact holds the part nowhere.
    pub contact_only: bool,
}

/// The quantity that ranks poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ranking {
    /// How contact holds the part ([`crate::mating`]). Poses come from planes and axes of both
    /// surfaces, and from a search by energy where those hold it nowhere.
    #[default]
    Contact,
    /// The energy under the docking weights, lowest first.
    Energy,
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
            ranking: Ranking::Contact,
            near: None,
            axis: None,
            others: Vec::new(),
            contact_only: false,
        }
    }
}

/// What docking found, and its cost. See the example of [`dock`](crate::dock).
#[derive(Debug)]
pub struct DockingResult {
    /// Distinct poses, the best first.
    pub poses: Vec<DockingPose>,
    /// What ranked them.
    pub ranking: Ranking,
    /// The lattices of a search by energy.
    pub lattices: GridLevels,
    /// Motions that map the moving part onto itself: poses that differ by one count as the same.
    pub symmetries: Vec<Pose>,
    /// The search by energy, where there was one.
    pub energy_search: Option<EnergySearch>,
    /// Spacing of the lattice that energies are of, metres; none if there are none.
    pub energy_spacing: Option<f64>,
    /// Nodes of that lattice, where energies are of what the poses reach.
    pub energy_nodes: Option<FieldNodes>,
    /// Why there are no energies, if the pair's fields cannot be computed.
    pub no_energies: Option<DockingError>,
    /// Wall time of the density fields, seconds.
    pub field_seconds: f64,
    /// The other stages, in order.
    pub stages: Vec<SearchStage>,
}

/// The work of a search by energy.
#[derive(Debug)]
pub struct EnergySearch {
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
    /// Wall time per rotation scored, seconds, without the screening.
    pub seconds_per_rotation: f64,
}

impl DockingResult {
    /// Wall time of all stages but the fields, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}

/// A search for the poses in which two parts fit. See the example of [`dock`](crate::dock).
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

    /// Searches, and reports the poses found. When the monitor cancels after poses have been found,
    /// the best of these are returned as they are.
    ///
    /// # Errors
    /// If the domain, the model or the memory limit does not allow the search, a part has no interior
    /// on a lattice, the state file is unusable or of another search, or the monitor cancels before
    /// any pose is found.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<DockingResult, DockingError> {
        self.require_clearance()?;
        self.require_use()?;
        match self.options.ranking {
            Ranking::Contact => self.run_by_contact(monitor),
            Ranking::Energy => self.run_by_energy(monitor),
        }
    }

    /// Poses that contact holds; if it holds the part nowhere, those of the lowest energy as well.
    fn run_by_contact(&self, monitor: &dyn Monitor) -> Result<DockingResult, DockingError> {
        let setup = self.setup;
        let domain = self.domain()?;
        // Settings that energies would be refused for; for want of memory there are none.
        let unlimited = PairBuilder {
            memory_limit: None,
            ..setup.builder
        };
        match unlimited.plan(&setup.fixed, &setup.moving, &setup.model) {
            // Contact needs no lattice.
            Ok(_) | Err(PairBuildError::TooSmall { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        setup.gamma()?;
        let began = Instant::now();
        let fixed = self.with_others();
        let search = MatingSearch::new(&fixed, &setup.moving, self.mating_options(&domain));
        let mut held = search.run(&[], monitor);
        let mut stages = vec![SearchStage {
            name: "contact",
            items: held.len(),
            seconds: began.elapsed().as_secs_f64(),
        }];
        let (mut energy_search, mut field_seconds) = (None, 0.0);
        // A state file and an exhaustive search are of energies: whoever asks for them gets both.
        let asked = self.options.exhaustive || self.options.state.is_some();
        let unsure = asked || held.first().is_none_or(|h| h.rank < CONVINCING);
        let allowed = self.unknown_to_energy().is_none() && !self.options.contact_only;
        if allowed && unsure && !monitor.cancelled() {
            match self.run_by_energy(monitor) {
                Ok(found) => {
                    let poses: Vec<Pose> = found.poses.iter().map(|p| p.found.pose).collect();
                    held = search.run(&poses, monitor);
                    if held.is_empty() {
                        return Ok(found);
                    }
                    stages.extend(found.stages);
                    (energy_search, field_seconds) = (found.energy_search, found.field_seconds);
                }
                Err(error) if asked || held.is_empty() => return Err(error),
                Err(error) => tracing::warn!(%error, "no search by energy"),
            }
        }
        if held.is_empty() {
            return Err(match monitor.cancelled() {
                true => DockingError::Cancelled,
                false => DockingError::NothingMates,
            });
        }
        let began = Instant::now();
        let energies = self.energies(&held, monitor);
        field_seconds += began.elapsed().as_secs_f64();
        let (energies, lattice, no_energies) = match energies {
            Ok((energies, spacing, nodes)) => (energies, Some((spacing, nodes)), None),
            Err(error) => (vec![PoseEnergies::NONE; held.len()], None, Some(error)),
        };
        let area = setup.moving.area();
        let poses = held.into_iter().zip(energies);
        Ok(DockingResult {
            poses: poses.map(|(h, e)| DockingPose::held(h, &e, area)).collect(),
            ranking: Ranking::Contact,
            lattices: self.lattices,
            symmetries: domain.symmetries,
            energy_search,
            energy_spacing: lattice.map(|l| l.0),
            energy_nodes: lattice.map(|l| l.1),
            no_energies,
            field_seconds,
            stages,
        })
    }

    /// The fixed part in its own frame together with the parts that are there already.
    fn with_others(&self) -> Cow<'_, TriangleMesh> {
        match self.options.others.is_empty() {
            true => Cow::Borrowed(&*self.setup.fixed),
            false => {
                let others = self.options.others.iter().map(|m| &**m);
                Cow::Owned(TriangleMesh::joined(
                    [&*self.setup.fixed].into_iter().chain(others),
                ))
            }
        }
    }

    fn mating_options(&self, domain: &SearchDomain) -> MatingSearchOptions {
        let limited = |d: &RotationDomain| !matches!(d, RotationDomain::Full { .. });
        let limited = self.options.rotations.as_ref().is_some_and(limited);
        MatingSearchOptions {
            top: self.options.top,
            clearance: self.options.mating_clearance,
            region: SearchRegion {
                near: self.options.near,
                places: (self.setup.half_extent.is_some())
                    .then_some((self.lattices.pivot, domain.places)),
                rotations: limited.then(|| (domain.rotations.clone(), domain.step)),
            },
            axis: self.options.axis,
            symmetries: domain.symmetries.clone(),
            present: Some(Pose::IDENTITY),
            ..MatingSearchOptions::default()
        }
    }

    /// Energies at poses in the fixed part's own frame, and spacing (metres) and nodes of their lattice.
    fn energies(
        &self,
        held: &[HeldPose],
        monitor: &dyn Monitor,
    ) -> Result<(Vec<PoseEnergies>, f64, FieldNodes), DockingError> {
        let setup = self.setup;
        let parts = [&*setup.fixed, &*setup.moving];
        let poses: Vec<Pose> = held.iter().map(|h| h.pose).collect();
        // Only what poses reach is computed: that decides about memory, not the parts' boxes.
        let unlimited = |spacing: Option<f64>| {
            let builder = PairBuilder {
                spacing,
                memory_limit: None,
                ..setup.builder
            };
            builder.plan(&setup.fixed, &setup.moving, &setup.model)
        };
        let mut plan = unlimited(setup.builder.spacing)?;
        let mut wider = ENERGY_SPACING * plan.spacing();
        while setup.builder.spacing.is_none() {
            plan = unlimited(Some(wider))?;
            if plan.bytes_at(parts, &poses) <= ENERGY_BYTES {
                break;
            }
            wider *= 1.5;
        }
        plan.require_bytes(plan.bytes_at(parts, &poses), setup.builder.memory_limit)?;
        let gamma = setup.gamma()?;
        let mut found = vec![PoseEnergies::NONE; held.len()];
        let mut nodes = FieldNodes::default();
        for (pair, indices) in plan.build_at(parts, &poses, setup.cache.as_ref(), monitor)? {
            let pair = pair.with_gamma(gamma)?;
            nodes.computed += pair.nodes().computed;
            nodes.whole = pair.nodes().whole;
            let weighed = with_docking_weights(&pair, self.search_options().ratio)?;
            let own = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
            let docking = DirectEvaluator::new(&weighed, &DirectOptions::FULL)?;
            let perfect = gamma * pair.mould_score();
            let of = |i: &usize| {
                let model = own.evaluate_full(&poses[*i]).response.energy;
                PoseEnergies {
                    docking: docking.evaluate_full(&poses[*i]).response.energy,
                    model,
                    quality: (-model / perfect).clamp(0.0, 1.0),
                }
            };
            let energies: Vec<PoseEnergies> = indices.par_iter().map(of).collect();
            for (i, energies) in indices.into_iter().zip(energies) {
                found[i] = energies;
            }
        }
        Ok((found, plan.spacing(), nodes))
    }

    /// Poses of the lowest energy. A state file keeps the scores of a cancelled run.
    fn run_by_energy(&self, monitor: &dyn Monitor) -> Result<DockingResult, DockingError> {
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
        let pairs = [&finest, own.as_ref().unwrap_or(&finest)];
        let poses = self.reports(&found, pairs, &domain)?;
        Ok(DockingResult {
            poses,
            ranking: Ranking::Energy,
            lattices: self.lattices,
            symmetries: domain.symmetries,
            energy_spacing: Some(finest.spacing()),
            energy_nodes: None,
            no_energies: None,
            field_seconds,
            energy_search: Some(EnergySearch {
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
                seconds_per_rotation: found.seconds_per_rotation(),
            }),
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

    /// What is known that energies do not know.
    fn unknown_to_energy(&self) -> Option<&'static str> {
        let options = &self.options;
        let kept_apart = (!options.others.is_empty()).then_some("keep apart");
        options.axis.map(|_| "axis").or(kept_apart)
    }

    /// Refuses what is known where the search asked for would not use it.
    fn require_use(&self) -> Result<(), DockingError> {
        let options = &self.options;
        let near = options.near.map(|_| "near");
        let known = match options.ranking {
            Ranking::Energy => near.or(self.unknown_to_energy()),
            Ranking::Contact if options.exhaustive || options.state.is_some() => {
                self.unknown_to_energy()
            }
            Ranking::Contact => None,
        };
        known.map_or(Ok(()), |known| Err(DockingError::Unused { known }))
    }

    /// Refuses a window whose correlation might not fit in memory.
    fn require_memory(&self, plan: &DockingPlan) -> Result<(), DockingError> {
        let needed = plan.scoring_bytes(rayon::current_num_threads());
        match self.setup.builder.memory_limit {
            Some(limit) if needed > limit => Err(DockingError::Memory { needed, limit }),
            _ => Ok(()),
        }
    }

    /// The reports of a search's poses, in the fixed part's own frame.
    fn reports(
        &self,
        found: &SearchResult,
        [finest, own]: [&Pair; 2],
        domain: &SearchDomain,
    ) -> Result<Vec<DockingPose>, DockingError> {
        let ranking_pair = finest.with_model(found.model)?;
        let conditions: Vec<f64> = (found.poses.par_iter())
            .take(CONDITION_POSES)
            .map(|p| Condition::at(&ranking_pair, &p.pose).number())
            .collect();
        let source = DirectEvaluator::new(own, &DirectOptions::FULL)?;
        let perfect = own.model().gamma * own.mould_score();
        let back = self.frame.inverse();
        let poses: Vec<Pose> = found.poses.iter().map(|p| back * p.pose).collect();
        let fixed = self.with_others();
        let search = MatingSearch::new(&fixed, &self.setup.moving, self.mating_options(domain));
        let area = self.setup.moving.area();
        let held = search.describe(&poses);
        let report = |(index, (p, held)): (usize, (&FoundPose, HeldPose))| {
            let model = source.evaluate_full(&p.pose).response.energy;
            let energies = PoseEnergies {
                docking: p.energy,
                model,
                quality: (-model / perfect).clamp(0.0, 1.0),
            };
            let pose = DockingPose::held(held, &energies, area);
            DockingPose {
                found: FoundPose {
                    pose: pose.found.pose,
                    ..*p
                },
                condition: conditions.get(index).copied(),
                ..pose
            }
        };
        Ok(found
            .poses
            .iter()
            .zip(held)
            .enumerate()
            .map(report)
            .collect())
    }
}

/// How many of the best poses have the condition number of their score found, cell by cell.
const CONDITION_POSES: usize = 16;

/// Energies at a pose, joules, and the score as a share of a perfect mould's.
#[derive(Clone, Copy)]
struct PoseEnergies {
    docking: f64,
    model: f64,
    quality: f64,
}

impl PoseEnergies {
    const NONE: Self = Self {
        docking: f64::NAN,
        model: f64::NAN,
        quality: f64::NAN,
    };
}

/// One pose found. See the example of [`dock`](crate::dock).
#[derive(Debug, Clone, PartialEq)]
pub struct DockingPose {
    /// Pose in the fixed part's own frame, and energy under the docking weights, NaN if there are no
    /// energies.
    pub found: FoundPose,
    /// How good the fit is, 0 to 1: the score under the setup's model as a share of what the smaller
    /// part would score in a perfect mould of itself ([`Pair::mould_score`]); NaN without energies.
    pub quality: f64,
    /// How contact holds the part.
    pub hold: HoldReport,
    /// What ranks poses by contact, nats: the hold, less what overlap costs.
    pub rank: f64,
    /// The joint that contact leaves, fixed part's frame.
    pub joint: Joint,
    /// Other poses in which the same contact holds the part.
    pub alike: Vec<Pose>,
    /// How far the solids lie in one another, measured from their surfaces.
    pub interference: Interference,
    /// Share of the moving part's volume that the fixed part fills as well, 0 ..= 1.
    pub overlap: f64,
    /// Area of the moving part's faces that lie against opposite faces of the fixed part
    /// ([`crate::DockingRequest::mating_clearance`]), square metres.
    pub mating_area: f64,
    /// Energy under the setup's own model and halo, joules: what an evaluator of the setup's pair
    /// gives at this pose, up to the error of the lattice; NaN without energies.
    pub model_energy: f64,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses of a search by energy only.
    pub condition: Option<f64>,
}

impl DockingPose {
    /// Of a part with this surface, square metres.
    fn held(held: HeldPose, energies: &PoseEnergies, area: f64) -> Self {
        Self {
            found: FoundPose {
                pose: held.pose,
                energy: energies.docking,
                refined: true,
                half_width: None,
                rotation: 0,
                lattice_energy: energies.docking,
            },
            quality: energies.quality,
            mating_area: held.hold.share * area,
            hold: held.hold,
            rank: held.rank,
            joint: held.joint,
            alike: held.alike,
            interference: held.interference,
            overlap: held.overlap,
            model_energy: energies.model,
            condition: None,
        }
    }
}

#[cfg(test)]
#[path = "docking_tests.rs"]
mod tests;
