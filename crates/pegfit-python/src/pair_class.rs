//! A pair as Python holds it: two parts, what is asked of them, and their fields once computed.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use fft_correlate::tolerance::{ToleranceError, TolerantDirect};
use fft_correlate::{
    DirectOptions, EnergyScale, Pair, PairBuilder, PairSetup, Pose, RotationDomain, ScoreModel,
    TiledEvaluator,
};
use glam::DVec3;
use haptic::HapticConfig;
use pegfit_scene::{FitChoice, Scene, SceneSetup};
use pyo3::prelude::*;
use sdf_grid::{Aabb, FieldCache, Monitor};

use crate::failure::{Failure, Kind};
use crate::memory_budget;
use crate::parts::{Mesh, Surface, index_array, vertex_array};
use crate::source::{AnySource, Source};
use crate::work::{guarded, run};

/// Rotations tabulated unless others are given, as in a scene: a ball about the modelled pose.
pub(crate) const DEFAULT_BALL: [f64; 2] = [20.0, 5.0];

/// Two parts and what is asked of them; shared with the threads that work on it.
pub(crate) struct Parts {
    pub(crate) setup: PairSetup,
    /// What the moving part is called.
    pub(crate) name: String,
    /// Rotations to tabulate, of the shapes, and whether a scene named them: docking looks
    /// everywhere otherwise.
    pub(crate) rotations: RotationDomain,
    pub(crate) rotations_named: bool,
    pub(crate) fit: FitChoice,
    pub(crate) device: HapticConfig,
    pub(crate) memory: u64,
    loaded: Loaded,
}

/// What has been computed of a pair.
#[derive(Default)]
pub(crate) struct Loaded {
    pair: Mutex<Option<Arc<Pair>>>,
    /// The last pair for a window alone.
    window: Mutex<Option<Arc<Pair>>>,
    energies: Mutex<Option<Arc<TiledEvaluator>>>,
}

fn taken<T>(from: &Mutex<Option<Arc<T>>>) -> Option<Arc<T>> {
    let kept = from.lock().unwrap_or_else(PoisonError::into_inner);
    kept.clone()
}

fn kept<T>(value: T, at: &Mutex<Option<Arc<T>>>) -> Arc<T> {
    let mut kept = at.lock().unwrap_or_else(PoisonError::into_inner);
    Arc::clone(kept.get_or_insert(Arc::new(value)))
}

impl Parts {
    /// The pair, its fields computed the first time. Threads that ask at once compute them at once:
    /// a worker that waited for another might be the one that the other waits for.
    pub(crate) fn pair(&self, monitor: &dyn Monitor) -> Result<Arc<Pair>, Failure> {
        if let Some(pair) = self.computed() {
            return Ok(pair);
        }
        Ok(kept(self.setup.load(monitor)?, &self.loaded.pair))
    }

    /// The pair, if its fields have been computed.
    pub(crate) fn computed(&self) -> Option<Arc<Pair>> {
        taken(&self.loaded.pair)
    }

    /// The pair for poses whose displacement of the pivot lies in a box, metres; the whole one if that is
    /// there or most of it would be needed.
    pub(crate) fn pair_in(
        &self,
        displacements: &Aabb,
        monitor: &dyn Monitor,
    ) -> Result<Arc<Pair>, Failure> {
        if let Some(pair) = self.computed() {
            return Ok(pair);
        }
        let last = taken(&self.loaded.window);
        let holds = |pair: &Arc<Pair>| {
            let held = pair.displacements();
            held.is_some_and(|d| {
                [displacements.min, displacements.max]
                    .into_iter()
                    .all(|p| d.contains(p))
            })
        };
        if let Some(pair) = last.filter(holds) {
            return Ok(pair);
        }
        let pair = self.setup.load_in(displacements, monitor)?;
        if pair.is_whole() {
            return Ok(kept(pair, &self.loaded.pair));
        }
        let pair = Arc::new(pair);
        let mut last = self
            .loaded
            .window
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        *last = Some(Arc::clone(&pair));
        Ok(pair)
    }

    /// The point of the moving shape that its poses are counted by, metres; nothing is computed.
    pub(crate) fn pivot(&self) -> Result<DVec3, Failure> {
        Ok(self.setup.plan_unlimited()?.pivot)
    }

    /// Energies at poses of the shapes, as exact as they are; of a large part only what poses reach is
    /// computed, when they ask. Threads share what has been loaded.
    pub(crate) fn energies(&self, monitor: &dyn Monitor) -> Result<Arc<TiledEvaluator>, Failure> {
        if let Some(energies) = taken(&self.loaded.energies) {
            return Ok(energies);
        }
        let energies = self.tiles(&DirectOptions::FULL, monitor)?;
        Ok(kept(energies, &self.loaded.energies))
    }

    /// The same of so many points.
    fn tiles(
        &self,
        options: &DirectOptions,
        monitor: &dyn Monitor,
    ) -> Result<TiledEvaluator, Failure> {
        if self.computed().is_none() && TiledEvaluator::is_worthwhile(&self.setup, options)? {
            return Ok(TiledEvaluator::new(&self.setup, options, monitor)?);
        }
        Ok(TiledEvaluator::of_whole(&*self.pair(monitor)?, options)?)
    }

    /// Direct quadrature, asked in the scene: on the pair's own lattice, or on one that meets a
    /// tolerance. Has loaded what poses near the fit need.
    fn direct(
        &self,
        tolerance: Option<f64>,
        options: &DirectOptions,
        monitor: &dyn Monitor,
    ) -> Result<Direct, Failure> {
        let (tiles, error) = match tolerance {
            None if *options == DirectOptions::FULL => (self.energies(monitor)?, None),
            None => (Arc::new(self.tiles(options, monitor)?), None),
            Some(tolerance) => {
                let found = self.tolerant(tolerance, monitor)?;
                (Arc::new(found.evaluator), Some(found.error))
            }
        };
        Ok(Direct {
            points: tiles.points(&self.setup.assembled, monitor)?,
            source: AnySource::Direct(tiles, self.setup.placement),
            error,
        })
    }

    fn tolerant(&self, tolerance: f64, monitor: &dyn Monitor) -> Result<TolerantDirect, Failure> {
        let mut setup = self.setup.clone();
        setup.builder.memory_limit = Some(self.memory);
        let (rotations, mut tried) = (&self.rotations, |_| ());
        let found = TolerantDirect::over(&setup, rotations, tolerance, monitor, &mut tried);
        found.map_err(|error| match error {
            ToleranceError::Missed { asked, reached, .. } => Failure::found(
                Kind::Scene,
                "tolerance",
                format!("at least {reached:.3}, the least within reach"),
                asked,
            ),
            other => other.into(),
        })
    }
}

/// A direct evaluator, its quadrature points, and the error of its probes if a tolerance was asked
/// for.
struct Direct {
    source: AnySource,
    points: usize,
    error: Option<f64>,
}

/// Two parts and what is asked of them.
#[pyclass(frozen, module = "pegfit._core", name = "Pair")]
pub(crate) struct PyPair {
    pub(crate) parts: Arc<Parts>,
    warnings: Vec<String>,
}

impl PyPair {
    fn new(parts: Parts, warnings: Vec<String>) -> Self {
        Self {
            parts: Arc::new(parts),
            warnings,
        }
    }
}

fn model_named(name: &str) -> Result<ScoreModel, Failure> {
    match name {
        "guided" => Ok(ScoreModel::GUIDED),
        "paper" => Ok(ScoreModel::PAPER),
        other => Err(Failure::found(
            Kind::Scene,
            "model",
            "guided or paper",
            other,
        )),
    }
}

fn positive(item: &str, value: f64) -> Result<f64, Failure> {
    match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(Failure::found(
            Kind::Scene,
            item,
            "a positive number",
            value,
        )),
    }
}

/// Half the sides of a box, metres, each positive.
pub(crate) fn half_extent(given: Option<[f64; 3]>) -> Result<Option<DVec3>, Failure> {
    let Some(given) = given else {
        return Ok(None);
    };
    for value in given {
        positive("half_extent", value)?;
    }
    Ok(Some(DVec3::from_array(given)))
}

#[pymethods]
impl PyPair {
    /// Two meshes that fit where they are.
    #[staticmethod]
    #[pyo3(signature = (fixed, moving, spacing, model, cache, peak_force, gamma, half_extent, memory))]
    #[expect(clippy::too_many_arguments, reason = "what a scene file would say")]
    fn of_meshes(
        fixed: &Mesh,
        moving: &Mesh,
        spacing: Option<f64>,
        model: &str,
        cache: Option<PathBuf>,
        peak_force: f64,
        gamma: Option<f64>,
        half_extent: Option<[f64; 3]>,
        memory: Option<u64>,
    ) -> Result<Self, Failure> {
        let memory = memory_budget(memory);
        let spacing = spacing.map(|h| positive("spacing", h)).transpose()?;
        let setup = PairSetup {
            model: model_named(model)?,
            builder: PairBuilder {
                spacing,
                memory_limit: Some(memory),
                ..PairBuilder::default()
            },
            energy: match gamma {
                Some(gamma) => EnergyScale::Gamma(positive("gamma", gamma)?),
                None => EnergyScale::PeakForce(positive("peak_force", peak_force)?),
            },
            half_extent: self::half_extent(half_extent)?,
            cache: cache.map(FieldCache::new).transpose()?,
            ..PairSetup::new(Arc::clone(&fixed.mesh), Arc::clone(&moving.mesh))
        };
        guarded(|| {
            Ok(TiledEvaluator::require_memory(
                &setup,
                &DirectOptions::FULL,
            )?)
        })?;
        let parts = Parts {
            setup,
            name: moving.name().to_owned(),
            rotations: RotationDomain::ball(DEFAULT_BALL[0], DEFAULT_BALL[1]),
            rotations_named: false,
            fit: FitChoice {
                assembled: Pose::IDENTITY,
                axis: None,
                depth: None,
            },
            device: HapticConfig::default(),
            memory,
            loaded: Loaded::default(),
        };
        Ok(Self::new(parts, Vec::new()))
    }

    /// The pair of a scene file, of several fixed parts the one called `fixed`.
    #[staticmethod]
    #[pyo3(signature = (path, fixed, memory))]
    fn from_scene(
        py: Python<'_>,
        path: PathBuf,
        fixed: Option<String>,
        memory: Option<u64>,
    ) -> PyResult<Self> {
        run(py, None, move |_| {
            let scene = Scene::read(&path)?.only(fixed.as_deref())?;
            let read = SceneSetup::read(scene, memory_budget(memory))?;
            let warnings = read.warnings.iter().map(ToString::to_string).collect();
            let parts = Parts {
                setup: read.parts,
                name: read.scene.moving.name,
                rotations: read.rotations,
                rotations_named: read.scene.rotations_given,
                fit: read.scene.fit,
                device: read.scene.device,
                memory: read.memory,
                loaded: Loaded::default(),
            };
            Ok(Self::new(parts, warnings))
        })
    }

    /// What had to be repaired, and what looks strange.
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Spacing of the lattices, metres, and numbers of triangles.
    fn describe(&self) -> Result<(f64, usize, usize), Failure> {
        let setup = &self.parts.setup;
        let spacing = guarded(|| Ok(setup.plan_unlimited()?.spacing()))?;
        let triangles = [&setup.fixed, &setup.moving].map(|m| m.triangles().len());
        Ok((spacing, triangles[0], triangles[1]))
    }

    /// Pose in the scene in which the parts fit.
    fn assembled(&self) -> [f64; 7] {
        crate::poses::row(&self.parts.fit.assembled)
    }

    /// The surface of a part where the scene places it: vertices in metres, (n, 3), and their indices,
    /// (m, 3). Poses of the scene move the moving part from there.
    fn placed<'py>(&self, py: Python<'py>, moving: bool) -> Surface<'py> {
        let setup = &self.parts.setup;
        let (mesh, at) = match moving {
            true => (&setup.moving, &setup.placement.moving),
            false => (&setup.fixed, &setup.placement.fixed),
        };
        let vertices: Vec<DVec3> = mesh.vertices().iter().map(|v| at.apply(*v)).collect();
        (
            vertex_array(py, &vertices),
            index_array(py, mesh.triangles()),
        )
    }

    /// The point of the placed moving part that poses turn least, metres.
    fn pivot(&self) -> Result<[f64; 3], Failure> {
        let pivot = guarded(|| self.parts.pivot())?;
        Ok(self.parts.setup.placement.moving.apply(pivot).to_array())
    }

    /// A direct evaluator of the pair, its points, and its error if a tolerance was asked for.
    #[pyo3(signature = (tolerance, max_points, progress))]
    fn evaluator(
        &self,
        py: Python<'_>,
        tolerance: Option<f64>,
        max_points: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Source, usize, Option<f64>)> {
        let tolerance = tolerance
            .map(|share| positive("tolerance", share))
            .transpose()?;
        let options = DirectOptions {
            max_points,
            ..DirectOptions::FULL
        };
        let parts = Arc::clone(&self.parts);
        let found = run(py, progress.as_ref(), move |watch| {
            parts.direct(tolerance, &options, watch)
        })?;
        Ok((Source::new(found.source), found.points, found.error))
    }
}
