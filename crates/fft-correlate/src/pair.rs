//! Two parts and the model between them: what every scorer works on.

use std::sync::Arc;

use glam::DVec3;
use sdf_grid::DensityField;

use crate::ScoreModel;

/// The fixed and the moving part's densities, the model, and the moving part's pivot.
///
/// The score splits into two products (`docs/conventions.md`):
/// `A1 * B1 + A2 * B2` with `A1 = l1 O1 + l2 I1`, `B1 = l2 I2`, `A2 = w l1 O1 + l2 I1`,
/// `B2 = l1 O2`; for separation weight `w = 1` they merge into one, for `w = 0` every product has
/// an interior factor and the integral runs over the two solids only.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Density of the fixed part in its own frame.
    pub fixed: Arc<DensityField>,
    /// Density of the moving part in its own frame.
    pub moving: Arc<DensityField>,
    /// Weights and scale.
    pub model: ScoreModel,
    /// The point of the moving part, metres in its frame, whose displacement the translation
    /// lattices of correlators and tables count: a rotation about it moves the part least.
    pub pivot: DVec3,
}
