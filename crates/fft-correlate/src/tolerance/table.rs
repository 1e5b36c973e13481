//! Lattice and rotation step of a table.
//!
//! Whole tables would take too long to try. The share of the error that comes from the lattice is
//! that of direct quadrature on it at random poses, by what half its spacing tells. The rest is how
//! far tables are from direct quadrature on the same lattice, found in balls of one step near a few
//! rotations, which hold just the nodes that queries at these read. Both add like squares.

use glam::{DQuat, DVec3};
use sdf_grid::Monitor;

use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::pair::fields::Pair;
use crate::pair::setup::PairSetup;
use crate::rotations::domain::RotationDomain;
use crate::table::accuracy::{HeldOut, random_pose, wrench_of_all};
use crate::table::energy_table::EnergyTable;
use crate::table::plan::TablePlan;
use crate::table::spec::TableSpec;
use crate::tolerance::error::{Limit, ToleranceError};
use crate::tolerance::refine::{BEYOND, SpacingSearch, TRIALS, Trial};

/// Poses at which lattices are compared.
const LATTICE_POSES: usize = 300;

/// Of these poses, and of those at the rotations that are probed.
const SEEDS: [u64; 2] = [18, 19];

/// Rotations that are probed.
const ROTATIONS: u64 = 3;

/// Poses at each.
const POSES: usize = 100;

/// Where in the balls the rotations are, in steps from the middle: as far as random ones.
const ASIDE: [DVec3; ROTATIONS as usize] = [
    DVec3::new(0.31, -0.12, 0.14),
    DVec3::new(-0.21, 0.33, 0.08),
    DVec3::new(0.05, -0.17, -0.36),
];

/// Share of the tolerance that the lattice may use up: errors of lattice and rotations add like
/// squares, and the probes are few.
pub const LATTICE_SHARE: f64 = 0.75;

/// The whole error of the probes must stay below this share of the tolerance.
const PROBE_SHARE: f64 = 0.9;

/// From one rotation step to the next, at most.
const REFINEMENT: f64 = 1.5;

/// Steps that are a good guess are not improved by less than this.
const WORTHWHILE: f64 = 1.1;

/// The order by which what rotations add to the error falls with their step.
const STEP_ORDER: f64 = 2.4;

/// The search for a step begins no coarser than this: how far it moves the part's rim, in widths by
/// which its product with the other is smoothed. At steps of about that size tables of smoothed
/// densities are as wrong by their rotations as by their lattice, whatever the spacing.
const FIRST_STEP: f64 = 2.4;

/// The coarsest rotation step that is tried, degrees.
const MAX_STEP: f64 = 15.0;

/// A plan that meets a tolerance, and what its error is to be measured against.
pub struct TolerantPlan {
    /// The table.
    pub plan: TablePlan,
    /// On lattices of half the spacing.
    pub reference: DirectEvaluator,
    /// Spacing of `reference`, metres.
    pub reference_spacing: f64,
}

impl TablePlan {
    /// The coarsest table over a setup's box of displacements and `rotations` whose errors of force
    /// and of torque, the rms of each as a share of its own rms, are both within `tolerance` by its
    /// probes. Spacing and rotation step are chosen; what they are in `setup` and `rotations` is where the search
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
    ) -> Result<TolerantPlan, ToleranceError> {
        let mut search = Search {
            setup: setup.clone(),
            rotations,
            tolerance,
            memory,
            monitor,
            tried,
        };
        search.setup.builder.memory_limit = Some(memory);
        let (mut found, direct, lattice) = search.lattice()?;
        search.step(&mut found.plan, &direct, lattice)?;
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
    /// A table on a lattice that is fine enough, its lattice's quadrature, and its error.
    fn lattice(&mut self) -> Result<(TolerantPlan, DirectEvaluator, f64), ToleranceError> {
        let search = SpacingSearch::new(&self.setup, self.tolerance, LATTICE_SHARE)?;
        let (rotations, memory, monitor) = (self.rotations, self.memory, self.monitor);
        search.refine_until(self.tried, |setup, half| {
            let at = |setup: &PairSetup| {
                let pair = setup.load_in_window(monitor)?;
                Ok::<_, ToleranceError>(TablePlan::new(setup, pair, rotations.clone())?)
            };
            let fine = at(half)?;
            let reference_spacing = fine.pair.spacing();
            let reference = DirectEvaluator::new(&fine.pair, &DirectOptions::FULL)?;
            drop(fine);
            let plan = at(setup)?;
            plan.scores(memory)?;
            let direct = DirectEvaluator::new(&plan.pair, &DirectOptions::FULL)?;
            let spec = &plan.spec;
            let held_out = HeldOut::at_random_poses(spec, &reference, LATTICE_POSES, SEEDS[0]);
            let report = held_out.errors_of(&direct, spec.pivot());
            let error = BEYOND * wrench_of_all(&[report], &spec.rotations);
            let found = TolerantPlan {
                plan,
                reference,
                reference_spacing,
            };
            Ok((error, (found, direct, error)))
        })
    }

    fn missed_error(&self, reached: f64, limit: Limit) -> ToleranceError {
        ToleranceError::Missed {
            asked: self.tolerance,
            reached,
            limit,
        }
    }

    /// Refines the rotation step until the probes meet the tolerance, or coarsens it while they do
    /// with ease, by what errors so far foretell; `lattice` is the error of `direct`, without rotations
    /// between.
    fn step(
        &mut self,
        plan: &mut TablePlan,
        direct: &DirectEvaluator,
        lattice: f64,
    ) -> Result<(), ToleranceError> {
        let Some(step) = step_of(&plan.spec.rotations) else {
            return Ok(());
        };
        let mut step = step.min(self.first_step(&plan.pair));
        let held_out = held_out(&plan.spec, direct);
        let asked = PROBE_SHARE * self.tolerance;
        let mut least = (f64::INFINITY, step);
        // The coarsest that is good enough, and the finest that is not.
        let (mut met, mut missed) = (0.0f64, f64::INFINITY);
        for _ in 0..TRIALS {
            if let Err(needed) = self.fits(plan, step) {
                if met > 0.0 {
                    break;
                }
                let limit = Limit::TableMemory {
                    best: least.1,
                    next: step,
                    needed,
                    limit: self.memory,
                };
                return Err(self.missed_error(least.0, limit));
            }
            let error = lattice.hypot(self.probe(plan, &held_out, step)?);
            (self.tried)(Trial::Step {
                step_deg: step,
                error,
            });
            if error < least.0 {
                least = (error, step);
            }
            match error <= asked {
                true => met = met.max(step),
                false => missed = missed.min(step),
            }
            let next = predicted_step(step, error, lattice, asked).min(MAX_STEP);
            // Between the two there is little to gain.
            if met > 0.0 && (next.min(missed / WORTHWHILE) < WORTHWHILE * met) {
                break;
            }
            step = next.clamp(WORTHWHILE * met, missed / WORTHWHILE);
        }
        if met == 0.0 {
            return Err(self.missed_error(least.0, Limit::Steps { best: least.1 }));
        }
        set_step(&mut plan.spec.rotations, met);
        Ok(())
    }

    /// See [`FIRST_STEP`]; degrees.
    fn first_step(&self, pair: &Pair) -> f64 {
        let width = pair
            .contact()
            .map_or(f64::INFINITY, |c| c.smoothing().width());
        let rim = self.setup.moving.radius_about(pair.pivot());
        (FIRST_STEP * width / rim).to_degrees()
    }

    /// Whether the whole table would fit in memory at a step; else its need, if it can be counted.
    fn fits(&self, plan: &TablePlan, step: f64) -> Result<(), Option<u128>> {
        let mut spec = plan.spec.clone();
        set_step(&mut spec.rotations, step);
        let bytes = spec.grid().ok().map(|grid| spec.bytes(grid.nodes().len()));
        match bytes {
            Some(bytes) if bytes <= u128::from(self.memory) => Ok(()),
            needed => Err(needed),
        }
    }

    /// How far small tables around the rotations held out, with rotation nodes `step` degrees apart, are
    /// from direct quadrature.
    fn probe(
        &self,
        plan: &TablePlan,
        held_out: &[HeldOut],
        step: f64,
    ) -> Result<f64, ToleranceError> {
        let energies = plan.energies(self.memory)?;
        let whole = &plan.spec;
        let mut reports = Vec::new();
        for (index, held_out) in held_out.iter().enumerate() {
            let rotation = held_out_rotation(whole, index as u64);
            let spec = TableSpec {
                rotations: probe_rotations(&whole.rotations, rotation, ASIDE[index], step),
                symmetry: None,
                ..whole.clone()
            };
            let table = EnergyTable::compute(spec, &energies, self.memory, self.monitor)?;
            reports.push(held_out.errors_of(&table, whole.pivot()));
        }
        Ok(wrench_of_all(&reports, &whole.rotations))
    }
}

/// The step at which the error should be the one asked for, where it is `error` with `step` and
/// `lattice` with none: errors add like squares.
fn predicted_step(step: f64, error: f64, lattice: f64, asked: f64) -> f64 {
    let share = |whole: f64| (whole * whole - lattice * lattice).max(0.0).sqrt();
    let wanted = share(asked) / share(error).max(f64::MIN_POSITIVE);
    step * wanted
        .powf(1.0 / STEP_ORDER)
        .clamp(1.0 / REFINEMENT, REFINEMENT)
}

/// Poses at the rotations that are probed, and what direct quadrature says there.
fn held_out(whole: &TableSpec, direct: &DirectEvaluator) -> Vec<HeldOut> {
    let at = |index| {
        let spec = TableSpec {
            rotations: single_rotation(held_out_rotation(whole, index)),
            ..whole.clone()
        };
        HeldOut::at_random_poses(&spec, direct, POSES, SEEDS[1] + index)
    };
    (0..ROTATIONS).map(at).collect()
}

/// Rotation `index` of those at which tables are probed.
fn held_out_rotation(whole: &TableSpec, index: u64) -> DQuat {
    random_pose(whole, 17, index).rotation
}

fn single_rotation(rotation: DQuat) -> RotationDomain {
    RotationDomain::List {
        rotations: vec![rotation.to_array()],
        margin_deg: 5.0,
    }
}

/// The rotations of a probe that holds `rotation`, `aside` steps from its middle.
fn probe_rotations(
    whole: &RotationDomain,
    rotation: DQuat,
    aside: DVec3,
    step_deg: f64,
) -> RotationDomain {
    match whole {
        RotationDomain::List { .. } => single_rotation(rotation),
        RotationDomain::Spin { axis, .. } => {
            let along = DVec3::from_array(*axis).normalize();
            let back = DQuat::from_axis_angle(along, -aside.x * step_deg.to_radians());
            RotationDomain::Spin {
                center: (back * rotation).to_array(),
                axis: *axis,
                range_deg: Some([-2.0 * step_deg, 2.0 * step_deg]),
                step_deg,
            }
        }
        RotationDomain::Ball { .. } | RotationDomain::Full { .. } => {
            let back = DQuat::from_scaled_axis(-aside * step_deg.to_radians());
            RotationDomain::Ball {
                center: (back * rotation).to_array(),
                angle_deg: 0.5 * step_deg,
                step_deg,
            }
        }
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
