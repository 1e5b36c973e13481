//! With which weights poses are found and ranked.

use crate::pair::fields::{Pair, PairError};
use crate::pair::model::ScoreModel;

/// Interior weight over exterior weight with which poses are found and ranked.
pub const DOCKING_RATIO: f64 = 12.0;

/// The pair under the docking weights: interiors at least `ratio` times as heavy as exteriors, no
/// separation.
pub(super) fn with_docking_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    pair.with_model(docking_weights(pair.model(), ratio))
}

/// The model with interiors at least `ratio` times as heavy as exteriors, and no separation.
pub(super) fn docking_weights(model: &ScoreModel, ratio: f64) -> ScoreModel {
    let own = model.lambda_interior / model.lambda_exterior;
    weights(model, ratio.max(own))
}

/// The pair with interiors `ratio` times as heavy as exteriors and no separation.
pub(super) fn with_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    pair.with_model(weights(pair.model(), ratio))
}

fn weights(model: &ScoreModel, ratio: f64) -> ScoreModel {
    ScoreModel {
        lambda_interior: ratio * model.lambda_exterior,
        separation_weight: 0.0,
        ..*model
    }
}
