//! What is summed over space.

use fft_correlate::{ScoreModel, Wrench};
use glam::DVec3;

use crate::table::one_sided::Side;

/// Score and its derivatives with respect to the moving part's place.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    /// `Re f`, cubic metres.
    pub(crate) score: f64,
    /// Torque about the moving part's origin first, fixed frame, per gamma.
    pub(crate) wrench: Wrench,
}

impl Sums {
    /// Adds a force at `arm` from the moving part's origin.
    pub(crate) fn pull(&mut self, arm: DVec3, force: DVec3) {
        self.wrench.torque += arm.cross(force);
        self.wrench.force += force;
    }
}

/// Weights of the products of one-sided densities.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weights([[f64; 2]; 2]);

impl Weights {
    pub(crate) fn new(model: &ScoreModel) -> Self {
        let (l1, l2) = (model.lambda_exterior, model.lambda_interior);
        let apart = model.separation_weight * l1 * l1;
        Self([[apart, l1 * l2], [l1 * l2, l2 * l2]])
    }

    pub(crate) fn of(&self, fixed: Side, moving: Side) -> f64 {
        self.0[fixed as usize][moving as usize]
    }

    /// Whether anything is summed where these sides (bit 0 outside, bit 1 inside) may meet.
    pub(crate) fn any(&self, fixed: u8, moving: u8) -> bool {
        let has = |sides: u8, side: Side| sides >> side as u8 & 1 == 1;
        Side::BOTH.into_iter().any(|a| {
            let met = |b| has(fixed, a) && has(moving, b) && self.of(a, b) != 0.0;
            Side::BOTH.into_iter().any(met)
        })
    }
}
