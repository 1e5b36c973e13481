//! The lattice of direct quadrature.

use sdf_grid::Monitor;

use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::geometry::se3::Pose;
use crate::pair::fields::Pair;
use crate::pair::setup::PairSetup;
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
    /// The pair on that lattice.
    pub pair: Pair,
    /// Its quadrature.
    pub evaluator: DirectEvaluator,
    /// The greater of the errors of force and torque at the poses compared, shares of their rms: four
    /// thirds of the differences from a lattice of half the spacing.
    pub error: f64,
    /// Spacing of the lattice that it was compared with, metres: half that of `pair`.
    pub reference_spacing: f64,
}

impl TolerantDirect {
    /// The coarsest lattice on which the errors of force and of torque at some of `poses` (of the
    /// shapes), the rms of each as a share of its own rms, are within `tolerance` by what half its
    /// spacing tells. The torque's rms counts as at least that of the force at a lever of a tenth of the
    /// moving part's radius. The spacing of `setup` is where the search begins; fields stay within its
    /// memory limit; `tried` hears of every step.
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
        let first = setup.load(monitor)?;
        let step = poses.len().div_ceil(POSES).max(1);
        let poses: Vec<Pose> = poses.iter().step_by(step).copied().collect();
        Self::refined(setup, first, &poses, tolerance, monitor, tried)
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
        let plan = TablePlan::new(setup, setup.load(monitor)?, rotations.clone())?;
        let draw = |index| random_pose(&plan.spec, SEED, index);
        let poses: Vec<Pose> = (0..POSES as u64).map(draw).collect();
        Self::refined(setup, plan.pair, &poses, tolerance, monitor, tried)
    }

    /// Begins with the setup's own pair.
    fn refined(
        setup: &PairSetup,
        first: Pair,
        poses: &[Pose],
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<Self, ToleranceError> {
        let lever = LEVER * setup.moving.bounds().diagonal() * 0.5;
        let search = SpacingSearch::new(setup, first, tolerance, 1.0);
        search.refine_until(tried, |setup, half| {
            let on = |setup: &PairSetup| {
                let pair = setup.load(monitor)?;
                let evaluator = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
                Ok::<_, ToleranceError>((pair, evaluator))
            };
            let (fine, evaluator) = on(half)?;
            let reference_spacing = fine.spacing();
            let held_out = HeldOut::at(poses, &evaluator);
            drop((fine, evaluator));
            let (pair, evaluator) = on(setup)?;
            let report = held_out.errors_of(&evaluator, pair.pivot());
            let error = BEYOND * error_of(&report, lever);
            let found = Self {
                error,
                pair,
                evaluator,
                reference_spacing,
            };
            Ok((error, found))
        })
    }
}

fn error_of(report: &ErrorReport, lever: f64) -> f64 {
    let force = report.force.scale;
    // Nothing is wrong where nothing is felt.
    let share = |rms: f64, scale: f64| if rms == 0.0 { 0.0 } else { rms / scale };
    let torque = share(report.torque.rms, report.torque.scale.max(lever * force));
    share(report.force.rms, force).max(torque)
}
