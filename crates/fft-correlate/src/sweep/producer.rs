//! What gives the energies of one rotation at all translations of a window.

use glam::DQuat;
use ndarray::ArrayViewMut3;

use crate::geometry::half_turn::HalfTurn;

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

    /// The same for the rotations that `rotation` and each of `turns` after it make, one output
    /// each. What a turn gives may differ by rounding from [`NodeEnergies::energies`], but not with
    /// the other turns asked for.
    fn energies_of_half_turns(
        &self,
        rotation: DQuat,
        turns: &[HalfTurn],
        scratch: &mut Self::Scratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        for (turn, out) in turns.iter().zip(outs) {
            self.energies(turn.rotation() * rotation, scratch, out.view_mut());
        }
    }
}
