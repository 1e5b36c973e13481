//! The paper's three pairs as files.

use std::path::Path;

use pegfit_scene::Scene;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{atomic, mesh_io};

use crate::error::CommandError;

/// Writes the meshes and the scene, and reads the scene back as a user would.
pub(super) fn write_scene(shape: PegInHole, out: &Path) -> Result<Scene, CommandError> {
    let name = shape.name();
    let (hole, peg) = shape.pair(0.0)?;
    for (part, mesh) in [("hole", &hole), ("peg", &peg)] {
        mesh_io::write_obj(out.join(format!("{name}_{part}.obj")), mesh)?;
    }
    let text = format!(
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
    );
    let path = out.join(format!("{name}.toml"));
    atomic::write(&path, text.as_bytes())?;
    Ok(Scene::read(&path)?)
}
