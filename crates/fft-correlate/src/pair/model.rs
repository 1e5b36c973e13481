//! The parameters that turn two densities into an energy.

use serde::{Deserialize, Serialize};

/// Weights of the score and the scale of the energy (eq_2, eq_6 and the separation weight of
/// `docs/conventions.md`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScoreModel {
    /// Kernel thickness, dimensionless, 0.03 ..= 0.5.
    pub sigma: f64,
    /// Weight of the exterior density (the paper's lambda_1), dimensionless, > 0.
    pub lambda_exterior: f64,
    /// Weight of the interior density (lambda_2), dimensionless, > 0.
    pub lambda_interior: f64,
    /// Weight of the exterior-exterior term: 1 is the paper's, 0 leaves it out. 0 ..= 1.
    pub separation_weight: f64,
    /// Energy per score, joules per cubic metre (eq_6), > 0.
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
        let positive = |v: f64| v.is_finite() && v > 0.0;
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
            "in 0.03..=0.5",
            self.sigma,
            (0.03..=0.5).contains(&self.sigma),
        )?;
        check(
            "lambda_exterior",
            "> 0",
            self.lambda_exterior,
            positive(self.lambda_exterior),
        )?;
        check(
            "lambda_interior",
            "> 0",
            self.lambda_interior,
            positive(self.lambda_interior),
        )?;
        let w = self.separation_weight;
        check("separation_weight", "in 0..=1", w, (0.0..=1.0).contains(&w))?;
        check("gamma", "> 0", self.gamma, positive(self.gamma))
    }
}

impl Default for ScoreModel {
    fn default() -> Self {
        Self::GUIDED
    }
}
