//! Where exteriors end.

use fft_correlate::ScoreModel;
use fft_correlate::pair::default_halo;
use sdf_grid::TriangleMesh;

use crate::error::TruthError;

/// The cut-off of the exterior at signed distance `xi`: 1 up to 70 % of the halo, 0 from the halo
/// on, a quintic step between (`docs/conventions.md`).
pub(crate) fn cut_off(xi: f64, halo: f64) -> f64 {
    let t = ((xi / halo - 0.7) / 0.3).clamp(0.0, 1.0);
    1.0 - t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// The halo that was asked for, or the model's own for the pair; metres.
pub(crate) fn halo_of(
    model: &ScoreModel,
    [fixed, moving]: [&TriangleMesh; 2],
    asked: Option<f64>,
) -> Result<f64, TruthError> {
    let own = || default_halo(model, fixed, moving);
    let halo = asked.unwrap_or_else(own);
    match halo > 0.0 && halo.is_finite() {
        true => Ok(halo),
        false => Err(TruthError::Option {
            name: "halo",
            expected: "> 0 m",
            found: halo,
        }),
    }
}
