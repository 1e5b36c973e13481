//! Correlation by transforms against direct quadrature, two implementations of one sum.

use fft_correlate::DirectEvaluator;
use pegfit_scene::Assembly;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use crate::error::CommandError;

/// Displacements compared.
const POSES: usize = 400;

/// Relative root mean square difference of both scores at random lattice displacements of the
/// assembled rotation, where both sum the same products.
pub(super) fn quadrature(
    assembly: &Assembly,
    direct: &DirectEvaluator,
) -> Result<f64, CommandError> {
    let window = assembly.design()?.window;
    let score = assembly.scores(&window)?;
    let rotation = assembly.setup.parts.assembled.rotation;
    let mut rng = SmallRng::seed_from_u64(11);
    let (mut difference, mut reference) = (0.0, 0.0);
    for _ in 0..POSES {
        let index = window.shape().map(|n| rng.random_range(0..n));
        let pose = assembly.pair.pose(rotation, window.displacement(index));
        let expected = direct.score(&pose).re;
        difference += (f64::from(score[index]) - expected).powi(2);
        reference += expected.powi(2);
    }
    Ok((difference / reference).sqrt())
}
