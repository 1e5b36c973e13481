//! What gives the energies of one rotation at all translations of a window.

use glam::DQuat;
use ndarray::{Array3, ArrayViewMut3};

use crate::geometry::half_turn::HalfTurn;
use crate::geometry::rotation_sum::RotationSum;

/// Computes the energies of one rotation at all translations of a window.
///
/// A correlator is one; so is, in tests, a closed form. The same rotation must always give the same
/// bits, whatever the thread or process.
pub trait NodeEnergies: Sync {
    /// Working memory of one thread.
    type Scratch: Send;

    /// Makes working memory.
    fn scratch(&self) -> Self::Scratch;

    /// Joules of one unit of the energies: 1 unless they come in another one, as scores do, whose
    /// unit is `-gamma`.
    fn unit(&self) -> f32 {
        1.0
    }

    /// Writes to `out`, shaped as the window, the energies of the poses with this rotation, in
    /// units of [`NodeEnergies::unit`].
    fn energies(&self, rotation: DQuat, scratch: &mut Self::Scratch, out: ArrayViewMut3<'_, f32>);

    /// The same for sums of the energies of near rotations: for each of `turns`, `sum` with all its
    /// rotations followed by that half turn. What a turn gives may differ by rounding from the sum
    /// of [`NodeEnergies::energies`], but not with the other turns asked for.
    fn sums(
        &self,
        sum: &RotationSum,
        turns: &[HalfTurn],
        scratch: &mut Self::Scratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        for (turn, out) in turns.iter().zip(outs) {
            let terms = sum.turned(*turn);
            let [(rotation, weight), more @ ..] = terms.terms() else {
                continue;
            };
            self.energies(*rotation, scratch, out.view_mut());
            if more.is_empty() {
                continue;
            }
            out.mapv_inplace(|e| *weight as f32 * e);
            let mut other = Array3::zeros(out.raw_dim());
            for (rotation, weight) in more {
                self.energies(*rotation, scratch, other.view_mut());
                out.scaled_add(*weight as f32, &other);
            }
        }
    }
}
