//! What fixes gamma, the scale from score to energy.

use glam::DVec3;

use crate::direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
use crate::geometry::placement::Placement;
use crate::geometry::se3::Pose;
use crate::pair::fields::{Pair, PairError};
use crate::setup::in_scene::InScene;
use crate::well::error::WellError;
use crate::well::gamma_for_peak_force;

/// What fixes the energy scale gamma of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EnergyScale {
    /// Joules per cubic metre.
    Gamma(f64),
    /// The largest force, newtons, on straight scans along x, y and z through the fit
    /// ([`crate::well::peak_force`]).
    PeakForce(f64),
}

/// Why a pair has no such energy scale.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EnergyScaleError {
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// There is no force to scale, or the one wanted is out of range.
    #[error(transparent)]
    Well(#[from] WellError),
    /// Gamma is out of range.
    #[error(transparent)]
    Pair(#[from] PairError),
}

impl EnergyScale {
    /// The pair with this energy scale. The parts fit at `assembled`; scans reach `reach` metres
    /// either way.
    ///
    /// # Errors
    /// If gamma would not be positive and finite, or a part has no interior on its lattice.
    pub fn apply(
        &self,
        pair: &Pair,
        assembled: &Pose,
        reach: DVec3,
    ) -> Result<Pair, EnergyScaleError> {
        Ok(pair.with_gamma(self.gamma(pair, &Pose::IDENTITY, assembled, reach)?)?)
    }

    /// Gamma for a pair whose fixed part was turned by `frame`; pose and reach are in the part's own
    /// frame.
    ///
    /// # Errors
    /// As [`EnergyScale::apply`].
    pub(crate) fn gamma(
        &self,
        pair: &Pair,
        frame: &Pose,
        assembled: &Pose,
        reach: DVec3,
    ) -> Result<f64, EnergyScaleError> {
        match *self {
            Self::Gamma(gamma) => Ok(gamma),
            Self::PeakForce(newtons) => {
                let source = DirectEvaluator::new(pair, &DirectOptions::REAL_TIME)?;
                let gamma = pair.model().gamma;
                let own = InScene::new(source, Placement::of_fixed(frame.inverse()));
                Ok(gamma_for_peak_force(
                    &own, gamma, assembled, reach, newtons,
                )?)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use sdf_grid::{Silent, shapes::PegInHole};

    use super::*;
    use crate::pair::builder::PairBuilder;
    use crate::pair::model::ScoreModel;
    use crate::well::peak_force;

    fn pair(frame: &Pose) -> Pair {
        let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let builder = PairBuilder {
            spacing: Some(0.004),
            ..PairBuilder::default()
        };
        let hole = hole.transformed(frame.rotation, frame.translation);
        builder
            .build(&hole, &peg, &ScoreModel::GUIDED, &Silent)
            .unwrap()
    }

    #[test]
    fn a_pair_has_the_peak_force_that_was_asked_for() {
        let reach = DVec3::splat(0.01);
        let scaled = EnergyScale::PeakForce(3.0)
            .apply(&pair(&Pose::IDENTITY), &Pose::IDENTITY, reach)
            .unwrap();
        let source = DirectEvaluator::new(&scaled, &DirectOptions::REAL_TIME).unwrap();
        let (peak, _) = peak_force(&source, &Pose::IDENTITY, reach);
        assert!((peak - 3.0).abs() < 1e-6, "{peak}");
        let given = EnergyScale::Gamma(7.0)
            .apply(&scaled, &Pose::IDENTITY, reach)
            .unwrap();
        assert_eq!(given.model().gamma, 7.0);
        let refused = EnergyScale::PeakForce(-1.0).apply(&scaled, &Pose::IDENTITY, reach);
        assert!(matches!(refused, Err(EnergyScaleError::Well(_))));
    }

    #[test]
    fn turning_the_fixed_part_changes_the_scale_by_what_the_lattice_sees() {
        let reach = DVec3::new(0.01, 0.004, 0.007);
        let scale = EnergyScale::PeakForce(5.0);
        let frame = Pose::new(DQuat::from_rotation_x(0.5), DVec3::ZERO);
        let gamma = |frame: &Pose| {
            scale
                .gamma(&pair(frame), frame, &Pose::IDENTITY, reach)
                .unwrap()
        };
        let (own, turned) = (gamma(&Pose::IDENTITY), gamma(&frame));
        assert!((turned / own - 1.0).abs() < 0.15, "{own} {turned}");
    }
}
