//! What fills a table: energies of one rotation at all translations of a window.

use glam::DQuat;
use ndarray::ArrayViewMut3;

use crate::geometry::half_turn::HalfTurn;
use crate::rotations::grid::RotationGrid;
use crate::table::spec::TableSpec;

/// Computes the energies of one rotation at all translations of a window.
///
/// A correlator is one; so is, in tests, a closed form. The same rotation must always give the same
/// bits, whatever the thread or process.
pub trait NodeEnergies: Sync {
    /// Working memory of one thread.
    type Scratch: Send;

    /// Makes working memory.
    fn scratch(&self) -> Self::Scratch;

    /// Writes to `out`, shaped as the window, the energies in joules of the poses with this
    /// rotation.
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

/// Computes the energies, joules, of some rotation nodes of a group, one after the other to
/// `joules`.
pub(crate) fn nodes<P: NodeEnergies>(
    spec: &TableSpec,
    producer: &P,
    rotation: DQuat,
    members: &[(HalfTurn, usize)],
    scratch: &mut P::Scratch,
    joules: &mut Vec<f32>,
) {
    let length = spec.window.len();
    joules.resize(members.len() * length, 0f32);
    let turns: Vec<_> = members.iter().map(|m| m.0).collect();
    let mut views: Vec<_> = joules
        .chunks_exact_mut(length)
        .map(|out| view(spec, out))
        .collect();
    producer.energies_of_half_turns(rotation, &turns, scratch, &mut views);
}

/// Computes the energies of one rotation node by itself, joules.
pub(crate) fn node<P: NodeEnergies>(
    spec: &TableSpec,
    grid: &RotationGrid,
    producer: &P,
    row: usize,
    scratch: &mut P::Scratch,
    out: &mut [f32],
) {
    producer.energies(grid.nodes()[row], scratch, view(spec, out));
}

/// A buffer of the window's length in the window's shape.
fn view<'a>(spec: &TableSpec, out: &'a mut [f32]) -> ArrayViewMut3<'a, f32> {
    ArrayViewMut3::from_shape(spec.window.shape(), out).expect("the buffer has the window's length")
}
