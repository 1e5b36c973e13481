//! The parameters that turn two densities into an energy, and the provenance of all that it depends on.

use glam::DVec3;
use sdf_grid::FieldProvenance;
use serde::{Deserialize, Serialize};

/// Weights of the score and the scale of the energy (eq_2, eq_6 and the separation weight of
/// `docs/conventions.md`).
///
/// ```
/// use fft_correlate::ScoreModel;
///
/// // The guided model with 20 mJ per cubic centimetre of score.
/// let model = ScoreModel { gamma: 2e4, ..ScoreModel::GUIDED };
/// assert!(model.validate().is_ok());
/// let error = ScoreModel { sigma: 0.9, ..model }.validate().unwrap_err();
/// assert_eq!((error.name, error.found), ("sigma", 0.9));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScoreModel {
    /// Kernel thickness, dimensionless, 0.03 ..= 0.5.
    pub sigma: f64,
    /// Weight of the exterior density (the paper's lambda_1), dimensionless, 1e-4 ..= 1e4.
    pub lambda_exterior: f64,
    /// Weight of the interior density (lambda_2), dimensionless, 1e-4 ..= 1e4.
    pub lambda_interior: f64,
    /// Weight of the exterior-exterior term: 1 is the paper's, 0 leaves it out. 0 ..= 1.
    pub separation_weight: f64,
    /// Energy per score, joules per cubic metre (eq_6), 1e-30 ..= 1e30.
    pub gamma: f64,
}

/// A model parameter out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("model parameter {name} must be {expected}, found {found}")]
pub struct ModelError {
    /// The parameter.
    pub name: &'static str,
    /// Its accepted range.
    pub expected: &'static str,
    /// What was given.
    pub found: f64,
}

/// Weights of the two densities. Correlation is done in single precision, where the transform of a
/// density of `n` nodes is up to about `n` times as large as the density, and the product of two is
/// summed over as many again: with a product of weights of at most 1e8, lattices of a thousand million
/// nodes stay below its largest number, 3e38; and as far above its smallest one.
const WEIGHTS: std::ops::RangeInclusive<f64> = 1e-4..=1e4;

/// Scales at which the energies of parts from nanometres to a hundred metres, and theirs forces per
/// metre, are numbers of single precision.
const GAMMAS: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

impl ScoreModel {
    /// The paper's choice: sigma 0.1, weights 1 and 3, separation counted.
    pub const PAPER: Self = Self {
        sigma: 0.1,
        lambda_exterior: 1.0,
        lambda_interior: 3.0,
        separation_weight: 1.0,
        gamma: 1.0,
    };

    /// A monotone funnel into the fit with walls that hold: sigma 0.2, weights 1 and 5, separation
    /// left out. The default.
    pub const GUIDED: Self = Self {
        sigma: 0.2,
        lambda_exterior: 1.0,
        lambda_interior: 5.0,
        separation_weight: 0.0,
        gamma: 1.0,
    };

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    pub fn validate(&self) -> Result<(), ModelError> {
        let check = |name, expected, found, ok: bool| {
            if ok {
                Ok(())
            } else {
                Err(ModelError {
                    name,
                    expected,
                    found,
                })
            }
        };
        check(
            "sigma",
            "from 0.03 to 0.5",
            self.sigma,
            (0.03..=0.5).contains(&self.sigma),
        )?;
        for (name, weight) in [
            ("lambda_exterior", self.lambda_exterior),
            ("lambda_interior", self.lambda_interior),
        ] {
            check(name, "from 1e-4 to 1e4", weight, WEIGHTS.contains(&weight))?;
        }
        let w = self.separation_weight;
        check("separation_weight", "in 0..=1", w, (0.0..=1.0).contains(&w))?;
        let gamma = self.gamma;
        check(
            "gamma",
            "from 1e-30 to 1e30",
            gamma,
            GAMMAS.contains(&gamma),
        )
    }
}

impl Default for ScoreModel {
    fn default() -> Self {
        Self::GUIDED
    }
}

/// Everything that a pair's energies depend on: two pairs of one provenance have the same energies.
///
/// Tables and docking states keep it; [`sdf_grid::provenance::difference`] says in what two differ.
///
/// ```
/// use fft_correlate::{PairBuilder, ScoreModel};
/// use sdf_grid::{provenance::difference, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let of = |spacing| {
///     let builder = PairBuilder { spacing: Some(spacing), ..PairBuilder::default() };
///     let plan = builder.plan(&hole, &peg, &ScoreModel::GUIDED)?;
///     Ok::<_, fft_correlate::PairBuildError>(plan.provenance(&hole, &peg))
/// };
/// assert!(difference(&of(0.004)?, &of(0.004)?).is_none());
/// let found = difference(&of(0.004)?, &of(0.002)?).expect("another lattice");
/// assert!(found.key.starts_with("fixed."));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairProvenance {
    /// The fixed part's density as it is multiplied; none for energies that come from no density.
    pub fixed: Option<FieldProvenance>,
    /// The moving part's density.
    pub moving: Option<FieldProvenance>,
    /// The moving part's pivot, metres in its frame (see [`crate::Pair::pose`]).
    pub pivot: [f64; 3],
    /// Weights of the score and the scale of the energy; last, since a scale that follows from a
    /// force changes with all of the above.
    pub model: ScoreModel,
}

impl PairProvenance {
    /// Energies that come from no densities, such as a closed form.
    pub fn without_fields(model: ScoreModel, pivot: DVec3) -> Self {
        Self {
            model,
            fixed: None,
            moving: None,
            pivot: pivot.to_array(),
        }
    }
}
