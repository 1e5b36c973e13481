//! Scenes for commands: read and loaded, with warnings printed.

use std::path::Path;

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
pub(super) fn scene_item(assembly: &Assembly, item: &str) -> String {
    format!("{}: {item}", assembly.scene().path.display())
}
