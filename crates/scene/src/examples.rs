//! Scenes of the paper's examples.

use sdf_grid::shapes::PegInHole;

/// The scene file of one of the paper's pairs, whose meshes are `NAME_hole.obj` and `NAME_peg.obj`
/// beside it, in metres.
pub fn example_text(shape: PegInHole) -> String {
    let name = shape.name();
    format!(
        "# The paper's {name} example: lengths in metres, zero clearance.\n\
         unit = \"m\"\n\
         fixed = \"{name}_hole.obj\"\n\
         moving = \"{name}_peg.obj\"\n\n\
         [lattice]\n\
         spacing = 0.00125\n\n\
         [window]\n\
         half_extent = [0.01, 0.01, 0.015]\n\n\
         [rotations]\n\
         kind = \"ball\"\n\
         angle_deg = 10.0\n\
         step_deg = 5.0\n"
    )
}
