//! How far outside its window and its rotations a table's energy fades to the far one.

use glam::DVec3;
use sdf_grid::FieldRecipe;

use crate::table::spec::TableSpec;

/// A table's angle of fading over its length, in radians by the moving part's radius.
const ANGLE: f64 = 2.0;

/// How far outside a table its energy fades.
///
/// Where a table ends its energy is seldom the far one, and a fade over `L` adds a force of up to
/// `1.5 |energy - far| / L`. The parts themselves have that energy over a way that is about as long
/// as the moving part, so a fade over its size adds no more force than contact has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fade {
    /// Beyond the first and the last node of the window, metres.
    pub length: f64,
    /// Beyond the rotations, radians, or what is left of a half turn.
    pub angle: f64,
}

impl TableSpec {
    /// How far outside the table its energy fades to [`TableSpec::far_energy`], and the force with
    /// it: over twice the moving part's radius about the pivot, its halo included (over the window's
    /// diagonal, where energies come from no density), and over two radians. Never over less than two
    /// nodes.
    pub fn fade(&self) -> Fade {
        let window = &self.window;
        let sides = DVec3::from_array(window.shape().map(|n| n as f64 - 1.0)) * window.spacing();
        let length = match &self.recipe.moving {
            Some(part) => 2.0 * radius(part, self.pivot()),
            None => sides.length(),
        };
        Fade {
            length: length.max(2.0 * window.spacing()),
            angle: ANGLE,
        }
    }
}

/// Greatest distance of a density's lattice from a point, metres.
fn radius(part: &FieldRecipe, point: DVec3) -> f64 {
    let lattice = &part.lattice;
    let sides = DVec3::from_array(lattice.shape().map(|n| n as f64 - 1.0)) * lattice.spacing();
    let (low, high) = (lattice.origin() - point, lattice.origin() + sides - point);
    low.abs().max(high.abs()).length()
}
