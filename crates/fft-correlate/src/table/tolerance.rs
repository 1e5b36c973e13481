//! Choosing lattice and rotation step for a force error that was asked for.
//!
//! Whole tables would take too long to try. The share of the error that comes from the lattice is
//! found at a few rotations alone (nothing is interpolated between rotations); the rest from balls of
//! one rotation step around the same rotations, which hold just the nodes that a query in their
//! middle reads. Truth is direct quadrature on a lattice of half the spacing.

use sdf_grid::Monitor;

use crate::direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
use crate::pair::builder::PairBuildError;
use crate::rotations::domain::RotationDomain;
use crate::setup::energy_scale::EnergyScale;
use crate::setup::pair_setup::{PairSetup, PairSetupError};
use crate::table::accuracy::{measure_error, random_pose};
use crate::table::design::{TableDesign, TableDesignError};
use crate::table::energy_table::EnergyTable;
use crate::table::error::TableError;
use crate::table::spec::TableSpec;

/// Rotations that are probed.
const ROTATIONS: u64 = 3;

/// Poses at each.
const POSES: usize = 300;

/// Share of the tolerance that the lattice may use up: errors of lattice and rotations add like
/// squares, and the probes are few.
pub const LATTICE_SHARE: f64 = 0.7;

/// The whole error of the probes must stay below this share of the tolerance.
const PROBE_SHARE: f64 = 0.9;

/// From one spacing or step to the next.
const REFINEMENT: f64 = 1.5;

/// Spacings and steps tried, at most.
pub const TRIALS: usize = 8;

/// The coarsest rotation step that is tried, degrees.
const MAX_STEP: f64 = 15.0;

/// A design that meets a tolerance, and what its error is to be measured against.
pub struct TolerantDesign {
    /// The table.
    pub design: TableDesign,
    /// On lattices of half the spacing.
    pub truth: DirectEvaluator,
    /// Spacing of `truth`, metres.
    pub reference_spacing: f64,
}

/// What was tried on the way, and the force error of its probes as a share of the rms force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trial {
    /// A spacing.
    Lattice {
        /// Metres.
        spacing: f64,
        /// The error.
        error: f64,
    },
    /// A rotation step.
    Step {
        /// Degrees.
        step_deg: f64,
        /// The error.
        error: f64,
    },
}

/// Why there is no finer table than the best that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Limit {
    /// As many spacings as are tried.
    Spacings {
        /// The best, metres.
        best: f64,
    },
    /// The pair on half the next spacing does not fit in memory.
    LatticeMemory {
        /// The best, metres.
        best: f64,
        /// The next, metres.
        next: f64,
        /// `the density fields` or `the correlation`.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// As many rotation steps as are tried.
    Steps {
        /// The best, degrees.
        best: f64,
    },
    /// The table with the next rotation step does not fit in memory.
    TableMemory {
        /// The best, degrees.
        best: f64,
        /// The next, degrees.
        next: f64,
        /// Bytes needed; none if it had more nodes than any table may have.
        needed: Option<u128>,
        /// Bytes allowed.
        limit: u64,
    },
}

/// Why no table was designed.
#[derive(Debug, thiserror::Error)]
pub enum ToleranceError {
    /// None that was tried meets the tolerance.
    #[error("force error of {asked} of the rms asked for, {reached} reached: {limit:?}")]
    Missed {
        /// Share of the rms force.
        asked: f64,
        /// The least share found.
        reached: f64,
        /// Where it was found, and why there is no finer one.
        limit: Limit,
    },
    /// A pair cannot be had.
    #[error(transparent)]
    Pair(PairSetupError),
    /// A pair has no such table.
    #[error(transparent)]
    Design(#[from] TableDesignError),
    /// A probe cannot be computed.
    #[error(transparent)]
    Table(TableError),
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<PairSetupError> for ToleranceError {
    fn from(error: PairSetupError) -> Self {
        match error {
            PairSetupError::Cancelled => Self::Cancelled,
            other => Self::Pair(other),
        }
    }
}

impl From<TableError> for ToleranceError {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Cancelled => Self::Cancelled,
            other => Self::Table(other),
        }
    }
}

impl ToleranceError {
    /// The computation that did not fit in memory, its need and the limit, bytes.
    fn memory(&self) -> Option<(&'static str, u64, u64)> {
        match *self {
            Self::Pair(PairSetupError::Build(PairBuildError::Memory { needed, limit, .. })) => {
                Some(("the density fields", needed, limit))
            }
            Self::Design(TableDesignError::Memory { needed, limit }) => {
                Some(("the correlation", needed, limit))
            }
            _ => None,
        }
    }
}

impl TableDesign {
    /// The coarsest table over a setup's box of displacements and `rotations` whose force error, the
    /// rms as a share of the rms force, is within `tolerance` by its probes. Spacing and rotation
    /// step are chosen; what they are in `setup` and `rotations` is where the search
    /// begins. Fields, correlations and the table stay within `memory` bytes; `tried` hears of every
    /// step.
    ///
    /// # Errors
    /// If no table within reach meets the tolerance, a pair or table cannot be had, or the monitor
    /// cancels.
    pub fn for_tolerance(
        setup: &PairSetup,
        rotations: &RotationDomain,
        tolerance: f64,
        memory: u64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<TolerantDesign, ToleranceError> {
        let mut search = Search {
            setup: setup.clone(),
            rotations,
            tolerance,
            memory,
            monitor,
            tried,
        };
        search.setup.builder.memory_limit = Some(memory);
        let mut found = search.lattice()?;
        search.step(&mut found)?;
        Ok(found)
    }
}

/// A choice under way.
struct Search<'a> {
    setup: PairSetup,
    rotations: &'a RotationDomain,
    tolerance: f64,
    memory: u64,
    monitor: &'a dyn Monitor,
    tried: &'a mut dyn FnMut(Trial),
}

impl Search<'_> {
    /// The coarsest lattice that is fine enough.
    fn lattice(&mut self) -> Result<TolerantDesign, ToleranceError> {
        let first = self.setup.load(self.monitor)?;
        // The same scale for all, or forces could not be compared.
        self.setup.energy = EnergyScale::Gamma(first.model().gamma);
        let mut spacing = first.spacing();
        drop(first);
        let mut best = (f64::INFINITY, spacing);
        for _ in 0..TRIALS {
            let (error, found) = match self.lattice_error(spacing) {
                Ok(found) => found,
                Err(e) => return Err(self.no_finer(e, best, spacing)),
            };
            (self.tried)(Trial::Lattice { spacing, error });
            if error <= LATTICE_SHARE * self.tolerance {
                return Ok(found);
            }
            if error < best.0 {
                best = (error, spacing);
            }
            spacing /= REFINEMENT;
        }
        Err(self.missed(best.0, Limit::Spacings { best: best.1 }))
    }

    /// Too little memory ends a search that has found something.
    fn no_finer(&self, error: ToleranceError, best: (f64, f64), next: f64) -> ToleranceError {
        match error.memory() {
            Some((what, needed, limit)) if best.0.is_finite() => {
                let limit = Limit::LatticeMemory {
                    best: best.1,
                    next,
                    what,
                    needed,
                    limit,
                };
                self.missed(best.0, limit)
            }
            _ => error,
        }
    }

    fn missed(&self, reached: f64, limit: Limit) -> ToleranceError {
        ToleranceError::Missed {
            asked: self.tolerance,
            reached,
            limit,
        }
    }

    /// The table at a spacing, and its error.
    fn lattice_error(&self, spacing: f64) -> Result<(f64, TolerantDesign), ToleranceError> {
        let at = |spacing: f64| {
            let mut setup = self.setup.clone();
            setup.builder.spacing = Some(spacing);
            let pair = setup.load(self.monitor)?;
            Ok::<_, ToleranceError>(TableDesign::new(&setup, pair, self.rotations.clone())?)
        };
        let reference_spacing = 0.5 * spacing;
        let fine = at(reference_spacing)?;
        let truth = DirectEvaluator::new(&fine.pair, &DirectOptions::FULL)?;
        drop(fine);
        let design = at(spacing)?;
        let error = self.probe(&design, &truth, None)?;
        let found = TolerantDesign {
            design,
            truth,
            reference_spacing,
        };
        Ok((error, found))
    }

    /// Refines the rotation step until the probes meet the tolerance, or coarsens it while they do
    /// with ease.
    fn step(&mut self, found: &mut TolerantDesign) -> Result<(), ToleranceError> {
        let Some(first) = step_of(&found.design.spec.rotations) else {
            return Ok(());
        };
        let mut step = first;
        let mut least = (f64::INFINITY, step);
        let mut met: Option<f64> = None;
        for _ in 0..TRIALS {
            if let Err(needed) = self.fits(&found.design, step) {
                if met.is_some() {
                    break;
                }
                let limit = Limit::TableMemory {
                    best: least.1,
                    next: step,
                    needed,
                    limit: self.memory,
                };
                return Err(self.missed(least.0, limit));
            }
            let error = self.probe(&found.design, &found.truth, Some(step))?;
            (self.tried)(Trial::Step {
                step_deg: step,
                error,
            });
            if error < least.0 {
                least = (error, step);
            }
            if error > PROBE_SHARE * self.tolerance {
                if met.is_some() {
                    break;
                }
                step /= REFINEMENT;
                continue;
            }
            // The coarsest so far that is good enough.
            let went_down = met.is_none() && step < first;
            met = Some(met.map_or(step, |m| m.max(step)));
            let coarser = (REFINEMENT * step).min(MAX_STEP);
            if went_down || coarser == step {
                break;
            }
            step = coarser;
        }
        let Some(step) = met else {
            return Err(self.missed(least.0, Limit::Steps { best: least.1 }));
        };
        set_step(&mut found.design.spec.rotations, step);
        Ok(())
    }

    /// Whether the whole table would fit in memory at a step; else its need, if it can be counted.
    fn fits(&self, design: &TableDesign, step: f64) -> Result<(), Option<u128>> {
        let mut spec = design.spec.clone();
        set_step(&mut spec.rotations, step);
        let bytes = spec.grid().ok().map(|grid| spec.bytes(grid.nodes().len()));
        match bytes {
            Some(bytes) if bytes <= u128::from(self.memory) => Ok(()),
            needed => Err(needed),
        }
    }

    /// The rms force error of small tables around random rotations of the domain, as a share of the
    /// rms force; at the rotations alone, or with rotation nodes `step` degrees apart.
    fn probe(
        &self,
        design: &TableDesign,
        truth: &DirectEvaluator,
        step: Option<f64>,
    ) -> Result<f64, ToleranceError> {
        let energies = design.energies(self.memory)?;
        let whole = &design.spec;
        let (mut error, mut scale) = (0.0, 0.0);
        for index in 0..ROTATIONS {
            let rotation = random_pose(whole, 17, index).rotation.to_array();
            let spec = TableSpec {
                rotations: around(&whole.rotations, rotation, step),
                symmetry: None,
                ..whole.clone()
            };
            let table = EnergyTable::compute(spec, &energies, self.memory, self.monitor)?;
            let force = measure_error(&table, truth, POSES, 18 + index).force;
            error += force.rms * force.rms;
            scale += force.scale * force.scale;
        }
        Ok((error / scale).sqrt())
    }
}

/// The rotations of a probe.
fn around(whole: &RotationDomain, center: [f64; 4], step: Option<f64>) -> RotationDomain {
    match (whole, step) {
        (RotationDomain::List { .. }, _) | (_, None) => RotationDomain::List {
            rotations: vec![center],
            margin_deg: 5.0,
        },
        (RotationDomain::Spin { axis, .. }, Some(step_deg)) => RotationDomain::Spin {
            center,
            axis: *axis,
            range_deg: Some([-2.0 * step_deg, 2.0 * step_deg]),
            step_deg,
        },
        (_, Some(step_deg)) => RotationDomain::Ball {
            center,
            angle_deg: 0.5 * step_deg,
            step_deg,
        },
    }
}

fn step_of(domain: &RotationDomain) -> Option<f64> {
    match domain {
        RotationDomain::List { .. } => None,
        RotationDomain::Spin { step_deg, .. }
        | RotationDomain::Ball { step_deg, .. }
        | RotationDomain::Full { step_deg, .. } => Some(*step_deg),
    }
}

fn set_step(domain: &mut RotationDomain, step: f64) {
    match domain {
        RotationDomain::List { .. } => {}
        RotationDomain::Spin { step_deg, .. }
        | RotationDomain::Ball { step_deg, .. }
        | RotationDomain::Full { step_deg, .. } => *step_deg = step,
    }
}
