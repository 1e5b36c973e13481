//! The lattice of direct quadrature.

use sdf_grid::Monitor;

use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
use crate::geometry::se3::Pose;
use crate::pair::fields::Pair;
use crate::pair::setup::{EnergyScale, PairSetup};
use crate::rotations::domain::RotationDomain;
use crate::table::accuracy::{ErrorReport, HeldOut, random_pose};
use crate::table::design::TableDesign;
use crate::tolerance::error::{Limit, ToleranceError};
use crate::tolerance::table::Trial;

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
        Self::after(setup, first, &poses, tolerance, monitor, tried)
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
        let design = TableDesign::new(setup, setup.load(monitor)?, rotations.clone())?;
        let draw = |index| random_pose(&design.spec, SEED, index);
        let poses: Vec<Pose> = (0..POSES as u64).map(draw).collect();
        Self::after(setup, design.pair, &poses, tolerance, monitor, tried)
    }

    /// Begins with the setup's own pair.
    fn after(
        setup: &PairSetup,
        first: Pair,
        poses: &[Pose],
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<Self, ToleranceError> {
        let mut setup = setup.clone();
        // The same scale for all, or forces could not be compared.
        setup.energy = EnergyScale::Gamma(first.model().gamma);
        let mut spacing = first.spacing();
        drop(first);
        let lever = LEVER * setup.moving.bounds().diagonal() * 0.5;
        let mut spacings = Spacings::new(tolerance);
        for _ in 0..TRIALS {
            let found = match Self::at(&setup, spacing, poses, lever, monitor) {
                Ok(found) => found,
                Err(e) => return Err(spacings.ended(tolerance, spacing, e)),
            };
            let error = found.error;
            tried(Trial::Lattice { spacing, error });
            if spacings.is_met(error) {
                return Ok(found);
            }
            spacing = spacings.after(spacing, error);
        }
        Err(spacings.missed(tolerance))
    }

    fn at(
        setup: &PairSetup,
        spacing: f64,
        poses: &[Pose],
        lever: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, ToleranceError> {
        let on = |spacing: f64| {
            let mut setup = setup.clone();
            setup.builder.spacing = Some(spacing);
            let pair = setup.load(monitor)?;
            let evaluator = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
            Ok::<_, ToleranceError>((pair, evaluator))
        };
        let reference_spacing = 0.5 * spacing;
        let (_, fine) = on(reference_spacing)?;
        let held_out = HeldOut::at(poses, &fine);
        drop(fine);
        let (pair, evaluator) = on(spacing)?;
        let report = held_out.errors_of(&evaluator, pair.pivot());
        Ok(Self {
            error: BEYOND * error_of(&report, lever),
            pair,
            evaluator,
            reference_spacing,
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

/// Spacings and steps tried, at most.
pub const TRIALS: usize = 8;

/// The error by its difference from that on half the spacing, which errs, too: by a quarter as much,
/// or somewhat more where surfaces touch.
pub(super) const BEYOND: f64 = 4.0 / 3.0;

/// From one spacing to the next, at least and at most: as errors fall with the spacing.
const REFINEMENTS: [f64; 2] = [1.15, 2.5];

/// Share of what is asked for that the next spacing aims at.
const MARGIN: f64 = 0.92;

/// The order by which errors fall with the spacing, until two are known.
const ORDER: f64 = 1.5;

/// The lowest and the highest order believed.
const ORDERS: [f64; 2] = [0.7, 2.0];

/// Spacings tried so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spacings {
    /// The error asked for of a lattice.
    asked: f64,
    /// The least error found, and its spacing, metres.
    best: Option<(f64, f64)>,
    order: f64,
}

impl Spacings {
    pub(super) fn new(asked: f64) -> Self {
        Self {
            asked,
            best: None,
            order: ORDER,
        }
    }

    pub(super) fn is_met(&self, error: f64) -> bool {
        error <= self.asked
    }

    /// The spacing to try after `spacing` with `error`, metres: finer by as little as errors foretell.
    pub(super) fn after(&mut self, spacing: f64, error: f64) -> f64 {
        if let Some((least, best)) = self.best {
            let found = (least / error).ln() / (best / spacing).ln();
            self.order = found.clamp(ORDERS[0], ORDERS[1]);
        }
        if self.best.is_none_or(|(least, _)| error < least) {
            self.best = Some((error, spacing));
        }
        let [least, most] = REFINEMENTS;
        let finer = (error / (MARGIN * self.asked)).powf(1.0 / self.order);
        spacing / finer.clamp(least, most)
    }

    /// Why there is nothing better after [`TRIALS`].
    pub(super) fn missed(&self, tolerance: f64) -> ToleranceError {
        let (reached, best) = self.best.unwrap_or((f64::INFINITY, 0.0));
        ToleranceError::Missed {
            asked: tolerance,
            reached,
            limit: Limit::Spacings { best },
        }
    }

    /// Too little memory for `next` ends a search that has found something.
    pub(super) fn ended(&self, tolerance: f64, next: f64, error: ToleranceError) -> ToleranceError {
        match (error.memory(), self.best) {
            (Some((what, needed, limit)), Some((reached, best))) => ToleranceError::Missed {
                asked: tolerance,
                reached,
                limit: Limit::LatticeMemory {
                    best,
                    next,
                    what,
                    needed,
                    limit,
                },
            },
            _ => error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_any_believable_order_are_met_soon_and_not_by_far() {
        for order in [0.8, 1.3, 2.0] {
            let error = |h: f64| 0.3 * h.powf(order);
            let mut spacings = Spacings::new(0.035);
            let (mut h, mut tried) = (1.0, 1);
            while !spacings.is_met(error(h)) {
                h = spacings.after(h, error(h));
                tried += 1;
            }
            assert!(tried <= TRIALS, "{tried} at order {order}");
            assert!(error(h) > 0.5 * 0.035, "{} at order {order}", error(h));
        }
    }
}
