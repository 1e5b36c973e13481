//! Everything that a pair's energies depend on.

use glam::DVec3;
use sdf_grid::FieldRecipe;
use serde::{Deserialize, Serialize};

use crate::pair::model::ScoreModel;

/// Everything that a pair's energies depend on: two pairs of one recipe have the same energies.
///
/// Tables and docking states keep it; [`sdf_grid::recipe::difference`] says in what two differ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairRecipe {
    /// The fixed part's density as it is multiplied; none for energies that come from no density.
    pub fixed: Option<FieldRecipe>,
    /// The moving part's density.
    pub moving: Option<FieldRecipe>,
    /// The moving part's pivot, metres in its frame (see [`crate::Pair::pose`]).
    pub pivot: [f64; 3],
    /// Weights of the score and the scale of the energy; last, since a scale that follows from a
    /// force changes with all of the above.
    pub model: ScoreModel,
}

impl PairRecipe {
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
