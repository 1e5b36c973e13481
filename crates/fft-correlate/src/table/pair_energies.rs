//! The energies of a pair at the nodes of a table, by FFT correlation.

use glam::DQuat;
use ndarray::ArrayViewMut3;

use crate::correlate::{CorrelateError, Correlator, CorrelatorScratch};
use crate::geometry::half_turn::{HalfTurn, half_turn_groups};
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::table::producer::NodeEnergies;

/// A pair's energies by FFT correlation.
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
        Ok(Self {
            correlator: Correlator::new(pair, window)?,
            gamma: pair.model().gamma,
        })
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
        Ok(Self {
            correlator: Correlator::for_groups(pair, window, &half_turn_groups(rotations))?,
            gamma: pair.model().gamma,
        })
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

    fn energies(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch,
        mut out: ArrayViewMut3<'_, f32>,
    ) {
        self.correlator.score(rotation, scratch, out.view_mut());
        self.weigh(out);
    }

    fn energies_of_half_turns(
        &self,
        rotation: DQuat,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        self.correlator
            .score_half_turns(rotation, turns, scratch, outs);
        outs.iter_mut().for_each(|out| self.weigh(out.view_mut()));
    }
}

impl PairEnergies {
    /// Scores to energies.
    fn weigh(&self, mut scores: ArrayViewMut3<'_, f32>) {
        let gamma = self.gamma as f32;
        scores.mapv_inplace(|score| -gamma * score);
    }
}
