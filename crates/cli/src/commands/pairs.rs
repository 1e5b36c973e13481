//! From a scene with several fixed parts to pairs that are loaded while the loop runs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::{EnergyScale, PairSetup};
use glam::DVec3;
use haptic::scene::{Content, LiveSceneError, LoadFailure, Loaded, Loader};
use haptic::scene::{beside_the_loop, direct_reach, table_reach};
use haptic::{LiveScene, PairSpec, SceneOptions};
use sdf_grid::{Aabb, TriangleMesh};

use super::stored;
use crate::context::Context;
use crate::error::CommandError;
use crate::scene::{Assembly, Part, Scene, explain_build, read_part, setup_of};
use crate::terminal::progress::Progress;

/// A scene whose near pairs are in memory.
pub(super) struct LivePairs {
    /// The pair of the first fixed part, which decides the energy scale and where the fit is.
    pub(super) assembly: Assembly,
    /// All pairs.
    pub(super) live: LiveScene,
    /// Their names.
    pub(super) names: Vec<String>,
}

impl LivePairs {
    /// Loads what is in reach of the assembled pose; the rest follows while the loop runs. `table`
    /// is interpolated for the first fixed part, in place of the scene's.
    ///
    /// # Errors
    /// If a part in reach cannot be loaded or the parts in reach exceed the scene's memory.
    pub(super) fn start(
        scene: Scene,
        table: Option<&Path>,
        context: &Context,
    ) -> Result<Self, CommandError> {
        let parts: Vec<Part> = scene.fixed_parts().cloned().collect();
        let assembly = Assembly::load(scene.clone().only(Some(&scene.fixed.name))?, context)?;
        let pivot = assembly.pair.pivot();
        let mut pairs: Vec<PairSpec> = Vec::new();
        let mut kinds: Vec<PairFiles> = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            let mut single = scene.clone().only(Some(&part.name))?;
            let chosen = table.filter(|_| index == 0).map(Path::to_owned);
            let table = chosen.or_else(|| part.table.clone());
            // A table has its own energy scale; all others share one.
            if table.is_none() {
                single.energy = EnergyScale::Gamma(assembly.pair.model().gamma);
            }
            let pair = PairFiles {
                table,
                scene: single,
                pivot,
            };
            if let Some(same) = kinds.iter().position(|other| other.same_part(&pair)) {
                let files = kinds[same].clone();
                let load = files.loader(None, context);
                let first = &pairs[same];
                pairs.push(PairSpec {
                    name: part.name.clone(),
                    placement: pair.scene.placement(),
                    reach: first.reach,
                    bytes: first.bytes,
                    files: first.files.clone(),
                    same_as: Some(same),
                    load,
                });
                kinds.push(pair);
                continue;
            }
            kinds.push(pair.clone());
            let first = match index {
                0 => Some(pair.loaded(Some(&assembly), context)?),
                _ => None,
            };
            pairs.push(pair.spec(&assembly.setup, first, context)?);
        }
        let options = options(&scene, &assembly, context);
        let start = assembly.assembled();
        let live = LiveScene::start(pairs, options, &start).map_err(|e| explain(&scene, e))?;
        Ok(Self {
            assembly,
            live,
            names: parts.into_iter().map(|p| p.name).collect(),
        })
    }
}

/// What a scene asks of loading; a part is looked for as far ahead as the moving part is long.
fn options(scene: &Scene, assembly: &Assembly, context: &Context) -> SceneOptions {
    let loading = &scene.loading;
    let longest = assembly.setup.moving.bounds().size().max_element();
    SceneOptions {
        pivot: assembly.pivot(),
        memory: loading.memory.unwrap_or(context.memory),
        ahead: loading.ahead.unwrap_or(longest),
        turn_ahead: loading.turn_ahead,
        watch: loading.watch,
    }
}

fn explain(scene: &Scene, error: LiveSceneError) -> CommandError {
    let file = scene.path.display();
    match error {
        LiveSceneError::Memory {
            pairs,
            needed,
            budget,
        } => CommandError::input(
            file.to_string(),
            "loading.memory_mib",
            format!("at least {} for {pairs}", in_mebibytes(needed)),
            in_mebibytes(budget),
        ),
        other => CommandError::bad_input(file.to_string(), other),
    }
}

fn in_mebibytes(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / f64::from(1 << 20))
}

/// One pair as files.
#[derive(Clone)]
struct PairFiles {
    /// With this fixed part only, and the energy scale of the whole scene.
    scene: Scene,
    table: Option<PathBuf>,
    /// What reaches speak of, moving part's own frame.
    pivot: DVec3,
}

impl PairFiles {
    /// Whether both are the same solids, wherever they stand, asked in the same way.
    fn same_part(&self, other: &Self) -> bool {
        let (a, b) = (&self.scene.fixed, &other.scene.fixed);
        a.meshes == b.meshes && self.table == other.table
    }

    /// `first` is given on the first load.
    fn spec(
        self,
        setup: &PairSetup,
        first: Option<Loaded>,
        context: &Context,
    ) -> Result<PairSpec, CommandError> {
        let (reach, bytes) = match &first {
            Some(loaded) => match &loaded.content {
                Content::Whole { bytes, .. } => (loaded.reach, *bytes),
                Content::Table(_) => (loaded.reach, 0),
            },
            None => self.survey(&setup.moving, context)?,
        };
        let mut files: Vec<PathBuf> = [&self.scene.fixed, &self.scene.moving]
            .into_iter()
            .flat_map(|part| part.meshes.iter().map(|m| m.path.clone()))
            .collect();
        files.extend(self.table.iter().map(|t| t.join("zarr.json")));
        Ok(PairSpec {
            name: self.scene.fixed.name.clone(),
            placement: self.scene.placement(),
            reach,
            bytes,
            files,
            same_as: None,
            load: self.loader(first, context),
        })
    }

    fn loader(self, mut first: Option<Loaded>, context: &Context) -> Loader {
        let quiet = Context {
            progress: Progress::new(true),
            json: false,
            memory: context.memory,
        };
        let load = move || -> Result<Loaded, LoadFailure> {
            match first.take() {
                Some(loaded) => Ok(loaded),
                None => Ok(beside_the_loop(|| self.loaded(None, &quiet))??),
            }
        };
        Box::new(load)
    }

    /// The reach and an upper estimate of the memory, from meshes and metadata alone.
    fn survey(
        &self,
        moving: &Arc<TriangleMesh>,
        context: &Context,
    ) -> Result<(Aabb, u64), CommandError> {
        if let Some(path) = &self.table {
            let store = stored::open(path)?;
            return Ok((table_reach(store.spec(), self.pivot), 0));
        }
        let fixed = read_part(&self.scene, &self.scene.fixed, context)?;
        let setup = setup_of(&self.scene, fixed, moving.clone(), context)?;
        let plan = setup.plan().map_err(|e| explain_build(&self.scene, e))?;
        let (bounds, radius) = self.extent(&setup);
        let reach = direct_reach(&setup.model, plan.density.halo, &bounds, radius);
        Ok((reach, plan.bytes))
    }

    fn loaded(&self, known: Option<&Assembly>, context: &Context) -> Result<Loaded, CommandError> {
        if let Some(path) = &self.table {
            return self.loaded_table(path, known, context);
        }
        let own;
        let assembly = match known {
            Some(assembly) => assembly,
            None => {
                own = Assembly::load(self.scene.clone(), context)?;
                &own
            }
        };
        let (bounds, radius) = self.extent(&assembly.setup);
        Loaded::direct(&assembly.pair, &bounds, radius)
            .map_err(|e| CommandError::bad_input(self.scene.path.display().to_string(), e))
    }

    /// Bounds of the fixed part, and the moving part's radius about the point that reaches speak of.
    fn extent(&self, setup: &PairSetup) -> (Aabb, f64) {
        let radius = setup.moving.radius_about(self.pivot);
        (setup.fixed.bounds(), radius)
    }

    /// The table, if it belongs to the parts as they are.
    fn loaded_table(
        &self,
        path: &Path,
        known: Option<&Assembly>,
        context: &Context,
    ) -> Result<Loaded, CommandError> {
        let store = stored::open(path)?;
        if known.is_some_and(|a| a.pair.model().gamma != store.spec().model().gamma) {
            context.progress.note(&format!(
                "note: {} was baked with another energy scale than the scene's; the table's counts",
                path.display()
            ));
        }
        match known {
            Some(assembly) => stored::expect_setup(&store, &self.scene, &assembly.setup)?,
            None => stored::expect_scene(&store, &self.scene, context)?,
        }
        Loaded::table(store, self.pivot).map_err(|e| CommandError::bad_input("table", e))
    }
}
