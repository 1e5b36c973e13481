//! Scenes for commands: read and loaded, with warnings printed.

use std::path::Path;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_scene::{Assembly, Scene, SceneSetup, SceneWarning};

use crate::context::Context;
use crate::error::CommandError;

/// Reads a scene file; of several fixed parts, the one called `fixed`.
pub(super) fn read(path: &Path, fixed: Option<&str>) -> Result<Scene, CommandError> {
    Ok(Scene::read(path)?.only(fixed)?)
}

/// Reads the meshes of a scene with one fixed part.
pub(super) fn setup(scene: Scene, context: &Context) -> Result<SceneSetup, CommandError> {
    let setup = SceneSetup::read(scene, context.memory)?;
    print_warnings(&setup.warnings, context);
    Ok(setup)
}

/// Reads the meshes and computes the fields.
pub(super) fn load(scene: Scene, context: &Context) -> Result<Assembly, CommandError> {
    let assembly = Assembly::new(setup(scene, context)?, &context.progress)?;
    context.progress.finish();
    Ok(assembly)
}

/// The same for poses in the scene's window.
pub(super) fn load_in_window(scene: Scene, context: &Context) -> Result<Assembly, CommandError> {
    let assembly = Assembly::in_window(setup(scene, context)?, &context.progress)?;
    context.progress.finish();
    Ok(assembly)
}

/// The same as far as a hand needs it: for poses near the fit, or, with a table, of its window.
pub(super) fn load_for_hand(
    scene: Scene,
    table: Option<&Path>,
    context: &Context,
) -> Result<Assembly, CommandError> {
    let setup = setup(scene, context)?;
    let assembly = match table.or(setup.scene.fixed.table.as_deref()) {
        Some(_) => Assembly::in_window(setup, &context.progress)?,
        None => Assembly::near_fit(setup, &context.progress)?,
    };
    context.progress.finish();
    Ok(assembly)
}

pub(super) fn print_warnings(warnings: &[SceneWarning], context: &Context) {
    for warning in warnings {
        let kind = match warning {
            SceneWarning::Scale { .. } => "warning",
            SceneWarning::Mesh(_) | SceneWarning::NoCache(_) | SceneWarning::EnergyScale { .. } => {
                "note"
            }
        };
        context.progress.note(&format!("{kind}: {warning}"));
    }
}

/// The subject of an error: the scene file and a part of it.
pub(super) fn scene_item(scene: &Scene, item: &str) -> String {
    format!("{}: {item}", scene.path.display())
}

/// A pose written as seven numbers.
pub(super) fn parse_pose(option: &str, words: &str, text: &str) -> Result<Pose, CommandError> {
    let refused = || {
        let expected = format!("{words}, or x,y,z,qx,qy,qz,qw in metres");
        CommandError::option(option, expected, text)
    };
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|_| refused())?;
    let [x, y, z, qx, qy, qz, qw] = numbers[..] else {
        return Err(refused());
    };
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let usable = numbers.iter().all(|v| v.is_finite()) && (rotation.length() - 1.0).abs() < 1e-3;
    usable
        .then(|| Pose::new(rotation, DVec3::new(x, y, z)))
        .ok_or_else(refused)
}
