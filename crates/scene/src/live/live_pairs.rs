//! From a scene with several fixed parts to pairs that are loaded while the loop runs.

use std::path::Path;
use std::sync::Arc;

use haptic::scene::LiveSceneError;
use haptic::{LiveScene, PairSpec, SceneOptions};
use sdf_grid::Monitor;

use crate::assembly::loaded::Assembly;
use crate::error::SceneError;
use crate::live::pair_files::{Extent, PairFiles};
use crate::scene::Scene;
use crate::setup::warning::SceneWarning;

/// A scene whose near pairs are in memory.
pub struct LivePairs {
    /// The pair of the first fixed part, which decides the energy scale and where the fit is.
    pub assembly: Assembly,
    /// All pairs.
    pub live: LiveScene,
    /// Names of the fixed parts, in the scene's order.
    pub names: Vec<String>,
    /// What the user should know besides the assembly's own warnings.
    pub warnings: Vec<SceneWarning>,
}

impl LivePairs {
    /// Loads what is in reach of the assembled pose; the rest follows while the loop runs. `assembly`
    /// is that of the scene's first fixed part, whose energies `table` interpolates, in place of the
    /// scene's own table. The thread that loads asks `monitor` whether to go on.
    ///
    /// # Errors
    /// If a part in reach cannot be loaded or the parts in reach exceed the scene's memory.
    pub fn start(
        scene: &Scene,
        assembly: Assembly,
        table: Option<&Path>,
        monitor: &Arc<dyn Monitor + Send>,
    ) -> Result<Self, SceneError> {
        let mut warnings = Vec::new();
        let files = PairFiles::all(scene, &assembly, table)?;
        let mut pairs: Vec<PairSpec> = Vec::with_capacity(files.len());
        for (index, pair) in files.iter().enumerate() {
            let same_as = files[..index].iter().position(|other| other.is_same(pair));
            let (source, extent, loaded) = match same_as {
                Some(first) => (&files[first], Extent::of_spec(&pairs[first]), None),
                None if index == 0 => {
                    let loaded = pair.first(&assembly, &mut warnings)?;
                    (pair, Extent::of_loaded(&loaded), Some(loaded))
                }
                None => {
                    let moving = &assembly.setup.parts.moving;
                    (pair, pair.survey(moving, &mut warnings)?, None)
                }
            };
            pairs.push(PairSpec {
                name: pair.scene.fixed.name.clone(),
                placement: pair.scene.placement(),
                reach: extent.reach,
                bytes: extent.bytes,
                files: source.watched(),
                same_as,
                load: source.clone().loader(loaded, Arc::clone(monitor)),
            });
        }
        let (options, start) = (options(scene, &assembly), assembly.assembled());
        let live = LiveScene::start(pairs, options, &start).map_err(|e| explain(scene, e))?;
        Ok(Self {
            assembly,
            live,
            names: scene.fixed_parts().map(|p| p.name.clone()).collect(),
            warnings,
        })
    }
}

/// What a scene asks of loading; a part is looked for as far ahead as the moving part is long.
fn options(scene: &Scene, assembly: &Assembly) -> SceneOptions {
    let (setup, loading) = (&assembly.setup, &scene.loading);
    let longest = setup.parts.moving.bounds().size().max_element();
    SceneOptions {
        pivot: assembly.pivot(),
        memory: loading.memory.unwrap_or(setup.memory),
        ahead: loading.ahead.unwrap_or(longest),
        turn_ahead: loading.turn_ahead,
        watch: loading.watch,
    }
}

fn explain(scene: &Scene, error: LiveSceneError) -> SceneError {
    match error {
        LiveSceneError::Memory {
            pairs,
            needed,
            budget,
        } => SceneError::Loading {
            path: scene.path.clone(),
            pairs,
            needed,
            budget,
        },
        other => SceneError::refused(&scene.path, "", other),
    }
}
