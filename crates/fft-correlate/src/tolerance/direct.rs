//! The lattice of direct quadrature.

use sdf_grid::Monitor;

use crate::direct::evaluator::DirectOptions;
use crate::direct::tiles::{TiledEvaluator, WatchedTiles};
use crate::geometry::se3::Pose;
use crate::pair::setup::{PairSetup, PairSetupError};
use crate::rotations::domain::RotationDomain;
use crate::table::accuracy::{ErrorReport, HeldOut, random_pose};
use crate::table::plan::TablePlan;
use crate::tolerance::error::ToleranceError;
use crate::tolerance::refine::{BEYOND, SpacingSearch, Trial};

/// Poses that are compared, at most.
const POSES: usize = 200;

/// Of those drawn at random.
const SEED: u64 = 18;

/// Lever, in radii of the moving part, at which the rms force is the least torque that errors of
/// torque are a share of: where symmetry leaves no torque, any error would be infinitely large.
const LEVER: f64 = 0.1;

/// Direct quadrature on a lattice as coarse as an error allows.
pub struct TolerantDirect {
    /// The setup on that lattice.
    pub setup: PairSetup,
    /// Its quadrature.
    pub evaluator: TiledEvaluator,
    /// The greater of the errors of force and torque at the poses compared, shares of their rms: four
    /// thirds of the differences from a lattice of half the spacing.
    pub error: f64,
    /// Spacing of the lattice that it was compared with, metres: half that of `setup`.
    pub reference_spacing: f64,
}

impl TolerantDirect {
    /// The coarsest lattice on which the errors of force and of torque at some of `poses` (of the
    /// shapes), the rms of each as a share of its own rms, are within `tolerance` by what half its
    /// spacing tells. The torque's rms counts as at least that of the force at a lever of a tenth of the
    /// moving part's radius. The spacing of `setup` is where the search begins; fields stay within its
    /// memory limit, and only what the poses reach is computed of a large part; `tried` hears of every
    /// step.
    ///
    /// # Errors
    /// If no lattice within reach meets the tolerance, a pair cannot be had, or the monitor cancels.
    pub fn new(
        setup: &PairSetup,
        poses: &[Pose],
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<Self, ToleranceError> {
        let step = poses.len().div_ceil(POSES).max(1);
        let poses: Vec<Pose> = poses.iter().step_by(step).copied().collect();
        Self::refined(setup, &poses, tolerance, monitor, tried)
    }

    /// The same at random poses over the setup's box of displacements and `rotations`.
    ///
    /// # Errors
    /// As [`TolerantDirect::new`], and if the box has too many nodes.
    pub fn over(
        setup: &PairSetup,
        rotations: &RotationDomain,
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<Self, ToleranceError> {
        let pair = setup.load_in_window(monitor)?;
        let plan = TablePlan::new(setup, pair, rotations.clone())?;
        let draw = |index| random_pose(&plan.spec, SEED, index);
        let poses: Vec<Pose> = (0..POSES as u64).map(draw).collect();
        Self::refined(setup, &poses, tolerance, monitor, tried)
    }

    fn refined(
        setup: &PairSetup,
        poses: &[Pose],
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<Self, ToleranceError> {
        let lever = LEVER * setup.moving.bounds().diagonal() * 0.5;
        let search = SpacingSearch::new(setup, tolerance, 1.0)?;
        search.refine_until(tried, |setup, half| {
            let on = |setup: &PairSetup| {
                let evaluator = TiledEvaluator::new(setup, &DirectOptions::FULL, monitor)?;
                // Those of one tile, one after the other.
                let order = evaluator.order(poses).into_iter().map(|i| poses[i]);
                let order: Vec<Pose> = order.collect();
                Ok::<_, ToleranceError>((evaluator, order))
            };
            let held_out = {
                let (evaluator, poses) = on(half)?;
                let source = evaluator.watched(monitor);
                let held_out = HeldOut::at(&poses, &source);
                check(&source)?;
                held_out
            };
            let plan = |setup: &PairSetup| setup.plan_unlimited().map_err(PairSetupError::from);
            let (evaluator, _) = on(setup)?;
            let error = {
                let source = evaluator.watched(monitor);
                let report = held_out.errors_of(&source, plan(setup)?.pivot);
                check(&source)?;
                BEYOND * error_of(&report, lever)
            };
            let found = Self {
                error,
                setup: setup.clone(),
                evaluator,
                reference_spacing: plan(half)?.spacing(),
            };
            Ok((error, found))
        })
    }
}

/// Refuses answers of a source that has failed.
fn check(source: &WatchedTiles<'_>) -> Result<(), ToleranceError> {
    match source.failure() {
        Some(failure) => Err(failure.clone().into()),
        None => Ok(()),
    }
}

fn error_of(report: &ErrorReport, lever: f64) -> f64 {
    let force = report.force.scale;
    // Nothing is wrong where nothing is felt.
    let share = |rms: f64, scale: f64| if rms == 0.0 { 0.0 } else { rms / scale };
    let torque = share(report.torque.rms, report.torque.scale.max(lever * force));
    share(report.force.rms, force).max(torque)
}
