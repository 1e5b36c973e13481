//! Refining the lattice until its error meets a tolerance.

use crate::pair::setup::{EnergyScale, PairSetup, PairSetupError};
use crate::tolerance::error::{Limit, ToleranceError};

/// One trial and the error of its probes: the greater of those of force and torque, each a share of
/// its rms.
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

/// Spacings and steps tried, at most.
pub const TRIALS: usize = 8;

/// The error by its difference from that on half the spacing, which errs, too: by a quarter as much,
/// or somewhat more where surfaces touch.
pub(super) const BEYOND: f64 = 4.0 / 3.0;

/// From one spacing to the next, at least and at most: as errors fall with the spacing.
const REFINEMENTS: [f64; 2] = [1.15, 2.5];

/// Share of the tolerance that the next spacing aims at.
const MARGIN: f64 = 0.92;

/// The order by which errors fall with the spacing, until two are known.
const ORDER: f64 = 1.5;

/// The lowest and the highest order believed.
const ORDERS: [f64; 2] = [0.7, 2.0];

/// A search for the coarsest spacing that meets a tolerance.
pub(super) struct SpacingSearch {
    /// The pair, with its energy scale fixed: on another scale forces could not be compared.
    setup: PairSetup,
    /// The first spacing, metres.
    first: f64,
    tolerance: f64,
    orders: Orders,
}

/// The errors found so far and the order by which they fall.
struct Orders {
    /// The error asked for of a lattice.
    asked: f64,
    /// The least error found, and its spacing, metres.
    best: Option<(f64, f64)>,
    order: f64,
}

impl SpacingSearch {
    /// Begins at the setup's own spacing; the lattice may use up `share` of the tolerance.
    ///
    /// # Errors
    /// If the setup has no energy scale or no lattice.
    pub(super) fn new(
        setup: &PairSetup,
        tolerance: f64,
        share: f64,
    ) -> Result<Self, PairSetupError> {
        Ok(Self {
            setup: PairSetup {
                energy: EnergyScale::Gamma(setup.gamma()?),
                ..setup.clone()
            },
            first: setup.plan_unlimited()?.spacing(),
            tolerance,
            orders: Orders::new(share * tolerance),
        })
    }

    /// Refines the lattice until `error_of` finds an error that is small enough, and returns what
    /// came with it. `error_of` gets the setup on a spacing and on half of it; `tried` hears of
    /// every spacing.
    ///
    /// # Errors
    /// What `error_of` returns, or [`ToleranceError::Missed`] if [`TRIALS`] spacings or the memory
    /// do not suffice.
    pub(super) fn refine_until<T>(
        mut self,
        tried: &mut dyn FnMut(Trial),
        error_of: impl Fn(&PairSetup, &PairSetup) -> Result<(f64, T), ToleranceError>,
    ) -> Result<T, ToleranceError> {
        let mut spacing = self.first;
        for _ in 0..TRIALS {
            let [setup, half] = [spacing, 0.5 * spacing].map(|spacing| {
                let mut setup = self.setup.clone();
                setup.builder.spacing = Some(spacing);
                setup
            });
            let (error, found) =
                error_of(&setup, &half).map_err(|e| self.out_of_memory(spacing, e))?;
            tried(Trial::Lattice { spacing, error });
            if error <= self.orders.asked {
                return Ok(found);
            }
            spacing = self.orders.finer(spacing, error);
        }
        let best = self.orders.best.map_or(0.0, |(_, best)| best);
        Err(self.missed_error(Limit::Spacings { best }))
    }

    fn missed_error(&self, limit: Limit) -> ToleranceError {
        ToleranceError::Missed {
            asked: self.tolerance,
            reached: self.orders.best.map_or(f64::INFINITY, |(error, _)| error),
            limit,
        }
    }

    /// Too little memory for `next` ends a search that has found something.
    fn out_of_memory(&self, next: f64, error: ToleranceError) -> ToleranceError {
        match (error.memory(), self.orders.best) {
            (Some((what, needed, limit)), Some((_, best))) => {
                self.missed_error(Limit::LatticeMemory {
                    best,
                    next,
                    what,
                    needed,
                    limit,
                })
            }
            _ => error,
        }
    }
}

impl Orders {
    fn new(asked: f64) -> Self {
        Self {
            asked,
            best: None,
            order: ORDER,
        }
    }

    /// The spacing to try after `spacing` with `error`, metres: finer by as little as errors foretell.
    fn finer(&mut self, spacing: f64, error: f64) -> f64 {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_any_believable_order_are_met_soon_and_not_by_far() {
        for order in [0.8, 1.3, 2.0] {
            let error = |h: f64| 0.3 * h.powf(order);
            let mut orders = Orders::new(0.035);
            let (mut h, mut tried) = (1.0, 1);
            while error(h) > 0.035 {
                h = orders.finer(h, error(h));
                tried += 1;
            }
            assert!(tried <= TRIALS, "{tried} at order {order}");
            assert!(error(h) > 0.5 * 0.035, "{} at order {order}", error(h));
        }
    }
}
