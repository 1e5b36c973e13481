//! The best docked pose with its joint, for robots (URDF), MuJoCo (MJCF) and CAD (mates).

use std::path::PathBuf;

use fft_correlate::DockingPose;
use pegfit_scene::{DockedPair, SceneSetup, write_mates, write_mjcf, write_urdf};

use crate::args::DockArgs;
use crate::error::CommandError;

/// Writes the files that were asked for of the best pose.
pub(super) fn write_exports(
    args: &DockArgs,
    setup: &SceneSetup,
    best: &DockingPose,
) -> Result<(), CommandError> {
    let scene = &setup.scene;
    let name = scene.path.file_stem().unwrap_or_default().to_string_lossy();
    let meshes = scene.fixed_parts().chain([&scene.moving]);
    let meshes = meshes.flat_map(|part| part.meshes.iter().map(|mesh| mesh.path.clone()));
    let kept: Vec<PathBuf> = meshes.chain(args.keep_apart.iter().cloned()).collect();
    let pair = DockedPair {
        name: &name,
        fixed: &setup.parts.fixed,
        moving: &setup.parts.moving,
        placed: setup.placement().fixed,
        pose: best.found.pose,
        joint: &best.joint,
        clearance: args.mating_clearance.map(|c| c * scene.unit.in_metres()),
        kept,
    };
    if let Some(path) = &args.urdf {
        write_urdf(&pair, path)?;
    }
    if let Some(path) = &args.mjcf {
        write_mjcf(&pair, path)?;
    }
    if let Some(path) = &args.mates {
        write_mates(&pair, path)?;
    }
    Ok(())
}
