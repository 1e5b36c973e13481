//! The energies of a pair, by FFT correlation.

use glam::DQuat;
use ndarray::ArrayViewMut3;

use crate::correlate::{
    CorrelateError, Correlator, CorrelatorPlan, CorrelatorScratch, PairSupport,
};
use crate::geometry::half_turn::{HalfTurn, HalfTurnGroup, half_turn_groups};
use crate::geometry::rotation_sum::RotationSum;
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::sweep::producer::NodeEnergies;

/// A pair's energies by FFT correlation: its scores, in the unit `-gamma` (eq_6).
pub struct PairEnergies {
    correlator: Correlator,
    gamma: f64,
}

impl PairEnergies {
    /// Plans the correlation of a pair over a window for single rotations.
    ///
    /// # Errors
    /// As [`Correlator::new`].
    pub fn plan(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        let plan = CorrelatorPlan::new(&PairSupport::of(pair)?, window)?;
        Ok(Self::planned(plan.for_sums(), pair))
    }

    /// The same for `rotations`: half turns share their work if there are enough among them.
    ///
    /// # Errors
    /// As [`Correlator::new`].
    pub fn plan_for(
        pair: &Pair,
        window: &TranslationWindow,
        rotations: &[DQuat],
    ) -> Result<Self, CorrelateError> {
        let groups = half_turn_groups(rotations);
        let plan = CorrelatorPlan::for_groups(&PairSupport::of(pair)?, window, &groups)?;
        Ok(Self::planned(plan.for_sums(), pair))
    }

    /// The same for rotations that have been grouped, and no sums of near ones.
    pub(crate) fn plan_for_groups(
        pair: &Pair,
        window: &TranslationWindow,
        groups: &[HalfTurnGroup],
    ) -> Result<Self, CorrelateError> {
        Ok(Self {
            correlator: Correlator::for_groups(pair, window, groups)?,
            gamma: pair.model().gamma,
        })
    }

    /// The same as planned.
    ///
    /// # Errors
    /// As [`Correlator::build`].
    pub fn build(plan: &CorrelatorPlan, pair: &Pair) -> Result<Self, CorrelateError> {
        Ok(Self {
            correlator: Correlator::build(plan, pair)?,
            gamma: pair.model().gamma,
        })
    }

    /// For the pair that was planned for.
    fn planned(plan: CorrelatorPlan, pair: &Pair) -> Self {
        Self {
            correlator: Correlator::planned(plan, pair),
            gamma: pair.model().gamma,
        }
    }

    /// The correlator.
    pub fn correlator(&self) -> &Correlator {
        &self.correlator
    }
}

impl NodeEnergies for PairEnergies {
    type Scratch = CorrelatorScratch;

    fn scratch(&self) -> CorrelatorScratch {
        self.correlator.scratch()
    }

    fn unit(&self) -> f32 {
        -(self.gamma as f32)
    }

    fn energies(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch,
        out: ArrayViewMut3<'_, f32>,
    ) {
        self.correlator.score(rotation, scratch, out);
    }

    fn sums(
        &self,
        sum: &RotationSum,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        self.correlator.score_sums(sum, turns, scratch, outs);
    }
}
