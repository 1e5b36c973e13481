//! Which spacing to try next.

use crate::tolerance::error::{Limit, ToleranceError};

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
