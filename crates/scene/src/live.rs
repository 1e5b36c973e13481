//! Pairs of a scene with several fixed parts, loaded while the loop runs.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fft_correlate::{EnergyScale, Pair, PairSetup, TableStore};
use glam::DVec3;
use haptic::scene::{
    Content, LiveSceneError, LoadFailure, LoadedPair, Loader, direct_reach, table_reach,
    with_spare_core,
};
use haptic::{LiveScene, PairSpec, SceneOptions};
use sdf_grid::{Aabb, Monitor, TriangleMesh};

use crate::assembly::Assembly;
use crate::error::SceneError;
use crate::scene::Scene;
use crate::setup::parts::{SceneWarning, read_part};
use crate::setup::scene_setup::{SceneSetup, pair_setup};

/// A scene whose near pairs are in memory.
///
/// ```no_run
/// use std::sync::Arc;
///
/// use pegfit_scene::{Assembly, LivePairs, Scene, SceneSetup};
/// use sdf_grid::{Monitor, Silent};
///
/// let scene = Scene::read("scene.toml")?;
/// let first = scene.clone().only(Some(&scene.fixed.name))?;
/// let assembly = Assembly::near_fit(SceneSetup::read(first, 4 << 30)?, &Silent)?;
/// let monitor: Arc<dyn Monitor + Send> = Arc::new(Silent);
/// let pairs = LivePairs::start(&scene, assembly, None, &monitor)?;
/// assert_eq!(pairs.live.states().len(), pairs.names.len());
/// # Ok::<(), pegfit_scene::SceneError>(())
/// ```
pub struct LivePairs {
    /// The pair of the first fixed part, which decides the energy scale and where the fit is.
    pub assembly: Assembly,
    /// All pairs.
    pub live: LiveScene,
    /// Names of the fixed parts, in the scene's order.
    pub names: Vec<String>,
    /// What the user should know besides the assembly's own warnings.
    pub warnings: Vec<SceneWarning>,
    /// Set when the thread that loads is no longer needed.
    over: Arc<AtomicBool>,
}

impl Drop for LivePairs {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// Cancels when its pairs are dropped, or another monitor does.
struct UntilDropped {
    over: Arc<AtomicBool>,
    inner: Arc<dyn Monitor + Send>,
}

impl Monitor for UntilDropped {
    fn cancelled(&self) -> bool {
        self.over.load(Ordering::Relaxed) || self.inner.cancelled()
    }
}

impl LivePairs {
    /// Loads what is in reach of the assembled pose; the rest follows while the loop runs, of a pair
    /// near its fit ([`Assembly::near_fit`]) what is near the hand. `assembly` is that of the scene's
    /// first fixed part, whose energies `table` interpolates, in place of the scene's own table. The
    /// thread that loads asks `monitor` whether to go on, and stops when the pairs are dropped.
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
        let over = Arc::new(AtomicBool::new(false));
        let monitor: Arc<dyn Monitor + Send> = Arc::new(UntilDropped {
            over: Arc::clone(&over),
            inner: Arc::clone(monitor),
        });
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
                load: source.clone().loader(loaded, Arc::clone(&monitor)),
            });
        }
        let (options, start) = (options(scene, &assembly), assembly.assembled());
        let live = LiveScene::start(pairs, options, &start).map_err(|e| explain(scene, e))?;
        Ok(Self {
            assembly,
            live,
            names: scene.fixed_parts().map(|p| p.name.clone()).collect(),
            warnings,
            over,
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

/// One pair as files.
#[derive(Clone)]
pub(super) struct PairFiles {
    /// With this fixed part only, and the energy scale of the whole scene.
    pub(super) scene: Scene,
    table: Option<PathBuf>,
    /// What reaches speak of, metres, moving part's own frame.
    pivot: DVec3,
    /// Bytes that computations may plan to use.
    memory: u64,
    /// Whether other pairs share its source, which is therefore the whole one.
    shared: bool,
}

/// What is known of a pair before it is loaded.
pub(super) struct Extent {
    /// Where the pivot must be, metres, fixed part's frame.
    pub(super) reach: Aabb,
    /// Memory it takes at most; 0 for a table that is kept in part.
    pub(super) bytes: u64,
}

impl Extent {
    pub(super) fn of_spec(spec: &PairSpec) -> Self {
        Self {
            reach: spec.reach,
            bytes: spec.bytes,
        }
    }

    pub(super) fn of_loaded(loaded: &LoadedPair) -> Self {
        Self {
            reach: loaded.reach,
            bytes: match &loaded.content {
                Content::Whole { bytes, .. } => *bytes,
                Content::Table(_) => 0,
            },
        }
    }
}

impl PairFiles {
    /// All pairs of a scene, in the order of its fixed parts; `table` is that of the first, in place
    /// of the scene's. `assembly` is the first's.
    pub(super) fn all(
        scene: &Scene,
        assembly: &Assembly,
        table: Option<&Path>,
    ) -> Result<Vec<Self>, SceneError> {
        let files = scene.fixed_parts().enumerate().map(|(index, part)| {
            let mut single = scene.clone().only(Some(&part.name))?;
            let given = table.filter(|_| index == 0).map(Path::to_owned);
            let table = given.or_else(|| part.table.clone());
            // A table has its own energy scale; all others share one.
            if table.is_none() {
                single.energy = EnergyScale::Gamma(assembly.pair.model().gamma);
            }
            Ok(Self {
                scene: single,
                table,
                pivot: assembly.pair.pivot(),
                memory: assembly.setup.memory,
                shared: false,
            })
        });
        let mut files: Vec<Self> = files.collect::<Result<_, SceneError>>()?;
        for index in 0..files.len() {
            let same = |other: &Self| other.is_same(&files[index]);
            files[index].shared = files.iter().filter(|f| same(f)).count() > 1;
        }
        Ok(files)
    }

    /// Whether both are the same solids, wherever they stand, asked in the same way.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.scene.fixed.meshes == other.scene.fixed.meshes && self.table == other.table
    }

    /// The files that decide it.
    pub(super) fn watched(&self) -> Vec<PathBuf> {
        let parts = [&self.scene.fixed, &self.scene.moving];
        let meshes = parts.into_iter().flat_map(|part| &part.meshes);
        let mut files: Vec<PathBuf> = meshes.map(|m| m.path.clone()).collect();
        files.extend(self.table.iter().map(|t| t.join("zarr.json")));
        files
    }

    /// The reach and an upper estimate of the memory, from meshes and metadata alone.
    pub(super) fn survey(
        &self,
        moving: &Arc<TriangleMesh>,
        warnings: &mut Vec<SceneWarning>,
    ) -> Result<Extent, SceneError> {
        if let Some(path) = &self.table {
            let store = TableStore::open(path)?;
            return Ok(Extent {
                reach: table_reach(store.spec(), self.pivot),
                bytes: 0,
            });
        }
        let fixed = read_part(&self.scene, &self.scene.fixed, warnings)?;
        let moving = Arc::clone(moving);
        let parts = pair_setup(&self.scene, fixed, moving, self.memory);
        let plan = parts.plan().map_err(|e| self.scene.fields_error(e))?;
        let (bounds, radius) = self.bounds(&parts);
        Ok(Extent {
            reach: direct_reach(&parts.model, plan.density.halo, &bounds, radius),
            bytes: plan.bytes,
        })
    }

    /// The pair of the scene's first fixed part, whose assembly is there.
    pub(super) fn first(
        &self,
        assembly: &Assembly,
        warnings: &mut Vec<SceneWarning>,
    ) -> Result<LoadedPair, SceneError> {
        let Some(path) = &self.table else {
            return self.direct(&assembly.setup.parts, &assembly.pair);
        };
        let store = TableStore::open(path)?;
        if assembly.pair.model().gamma != store.spec().model().gamma {
            warnings.push(SceneWarning::EnergyScale {
                table: path.clone(),
            });
        }
        self.interpolated(store, &assembly.setup)
    }

    /// What loads it; `first` is given on the first load. The threads that load ask `monitor`.
    pub(super) fn loader(
        self,
        mut first: Option<LoadedPair>,
        monitor: Arc<dyn Monitor + Send>,
    ) -> Loader {
        let load = move |at: DVec3| -> Result<LoadedPair, LoadFailure> {
            match first.take() {
                Some(loaded) => Ok(loaded),
                None => Ok(with_spare_core(|| self.load(at, &*monitor))??),
            }
        };
        Box::new(load)
    }

    /// Near a place of the pivot, metres, fixed shape's frame.
    fn load(&self, at: DVec3, monitor: &dyn Monitor) -> Result<LoadedPair, SceneError> {
        // Opened first: a table that is not there is no reason to read meshes.
        let store = self.table.as_deref().map(TableStore::open).transpose()?;
        let setup = SceneSetup::read(self.scene.clone(), self.memory)?;
        match store {
            Some(store) => self.interpolated(store, &setup),
            None => {
                let pair = match self.shared {
                    true => setup.pair_everywhere(monitor)?,
                    false => setup.pair_near(at - self.pivot, monitor)?,
                };
                self.direct(&setup.parts, &pair)
            }
        }
    }

    fn direct(&self, parts: &PairSetup, pair: &Pair) -> Result<LoadedPair, SceneError> {
        let (bounds, radius) = self.bounds(parts);
        let loaded = LoadedPair::direct(pair, &bounds, radius);
        let loaded = loaded.map_err(|e| SceneError::refused(&self.scene.path, "", e))?;
        let right = pair.displacements();
        Ok(LoadedPair {
            right: right.map(|d| Aabb::around([self.pivot + d.min, self.pivot + d.max])),
            ..loaded
        })
    }

    /// The table, if it belongs to the parts as they are.
    fn interpolated(
        &self,
        store: TableStore,
        setup: &SceneSetup,
    ) -> Result<LoadedPair, SceneError> {
        setup.expect_table(&store)?;
        Ok(LoadedPair::table(store, self.pivot)?)
    }

    /// Bounds of the fixed part, and the moving part's radius about the point that reaches speak of,
    /// metres.
    fn bounds(&self, parts: &PairSetup) -> (Aabb, f64) {
        (parts.fixed.bounds(), parts.moving.radius_about(self.pivot))
    }
}
