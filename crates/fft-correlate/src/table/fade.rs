//! How far outside its window a table's energy fades to the far one.

use glam::DVec3;
use sdf_grid::FieldRecipe;

use crate::table::spec::TableSpec;

impl TableSpec {
    /// How far outside the window the energy has faded to [`TableSpec::far_energy`], metres: the
    /// moving part's radius about the pivot, its halo included (the window's diagonal where energies
    /// come from no density), and never less than two nodes.
    ///
    /// Where a window ends, the energy is seldom the far one. What is read there goes on outside,
    /// without its slope outwards, and fades over `L`, which adds a force of up to
    /// `1.5 |energy - far| / L`. The parts themselves lose that energy over a way that is about as
    /// long as the moving part, so this is less than contact has. Outside the rotations the energy
    /// fades over what is left of the half turn.
    pub fn fade_length(&self) -> f64 {
        let window = &self.window;
        let sides = DVec3::from_array(window.shape().map(|n| n as f64 - 1.0)) * window.spacing();
        let length = match &self.recipe.moving {
            Some(part) => radius(part, self.pivot()),
            None => sides.length(),
        };
        length.max(2.0 * window.spacing())
    }
}

/// Greatest distance of a density's lattice from a point, metres.
fn radius(part: &FieldRecipe, point: DVec3) -> f64 {
    let lattice = &part.lattice;
    let sides = DVec3::from_array(lattice.shape().map(|n| n as f64 - 1.0)) * lattice.spacing();
    let (low, high) = (lattice.origin() - point, lattice.origin() + sides - point);
    low.abs().max(high.abs()).length()
}
