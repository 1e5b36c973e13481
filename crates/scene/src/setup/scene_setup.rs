//! A scene whose meshes have been read: solids, lattice, displacements and rotations; and its parts where
//! they are assembled.

use std::sync::Arc;

use fft_correlate::{
    DirectOptions, Docking, DockingRequest, DockingResult, Pair, PairBuilder, PairSetup, Placement,
    Pose, RotationDomain, TileError, TiledEvaluator,
};
use glam::DVec3;
use sdf_grid::{Aabb, FieldCache, LengthUnit, Monitor, TriangleMesh};

use crate::error::SceneError;
use crate::scene::{Part, Scene};
use crate::setup::parts::{SceneWarning, compare_scale, read_part};

/// Near the fit a pair is computed in part if that is at most this share of it.
const FAR_LESS: f64 = 0.35;

/// Near is this share of the moving part's longest side.
const NEAR: f64 = 0.5;

/// A scene with one fixed part whose meshes have been read; nothing is computed yet.
///
/// ```
/// use pegfit_scene::{Scene, SceneSetup};
/// use sdf_grid::shapes::PegInHole;
///
/// let text = "unit = \"mm\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\nlattice.spacing = 4";
/// let scene = Scene::parse("scene.toml", text)?;
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = SceneSetup::from_solids(scene, hole, peg, 1 << 30)?;
/// // Lattices and memory of its pair, before anything is computed.
/// let plan = setup.parts.plan()?;
/// assert!(plan.spacing() == 0.004 && plan.bytes < setup.memory);
/// // The peg ends flush with the block of 30 mm.
/// assert!((setup.bounds(0.0).max.z - 0.015).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct SceneSetup {
    /// The scene.
    pub scene: Scene,
    /// Its parts, each in its own frame, and what is asked of their pair there.
    pub parts: PairSetup,
    /// The rotations that it names, of the shapes.
    pub rotations: RotationDomain,
    /// Bytes that computations may plan to use.
    pub memory: u64,
    /// What its user should know.
    pub warnings: Vec<SceneWarning>,
}

impl SceneSetup {
    /// Reads the meshes of a scene with one fixed part; computations may use `memory` bytes.
    ///
    /// # Errors
    /// If the scene has several fixed parts, or a mesh or rotation cannot be used.
    pub fn read(scene: Scene, memory: u64) -> Result<Self, SceneError> {
        let scene = scene.only(None)?;
        let mut warnings = Vec::new();
        let fixed = read_part(&scene, &scene.fixed, &mut warnings)?;
        let moving = read_part(&scene, &scene.moving, &mut warnings)?;
        let mut setup = Self::from_solids(scene, fixed, moving, memory)?;
        warnings.append(&mut setup.warnings);
        // A folder of cached fields that cannot be made is no reason to stop.
        match FieldCache::new(&setup.scene.cache) {
            Ok(cache) => setup.parts.cache = Some(cache),
            Err(e) => warnings.push(SceneWarning::NoCache(e.to_string())),
        }
        setup.warnings = warnings;
        Ok(setup)
    }

    /// The same of solids that are there, metres, each in its part's own frame; nothing is kept
    /// between runs.
    ///
    /// # Errors
    /// If the scene has several fixed parts, or a rotation cannot be used.
    pub fn from_solids(
        scene: Scene,
        fixed: TriangleMesh,
        moving: TriangleMesh,
        memory: u64,
    ) -> Result<Self, SceneError> {
        let scene = scene.only(None)?;
        let rotations = (scene.rotations.in_shapes(&scene.placement()))
            .map_err(|e| SceneError::refused(&scene.path, "rotations", e))?;
        let warnings = compare_scale(&scene, &fixed, &moving).into_iter().collect();
        Ok(Self {
            parts: pair_setup(&scene, fixed, Arc::new(moving), memory),
            scene,
            rotations,
            memory,
            warnings,
        })
    }

    /// The pair, its fields computed or found in the cache, with the scene's energy scale.
    ///
    /// # Errors
    /// If the fields cannot be had or do not fit in memory, or the monitor cancels.
    pub fn pair(&self, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        (self.parts.load(monitor)).map_err(|e| self.scene.pair_error(e))
    }

    /// The pair for poses in the scene's window, and in a box of its size about the fit
    /// ([`PairSetup::load_in`]).
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pair_in_window(&self, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        let parts = &self.parts;
        let pivot = self.pivot()?;
        let (fit, reach) = (parts.assembled.apply(pivot) - pivot, parts.reach());
        let about_fit = Aabb::around([fit - reach, fit + reach]);
        let window = parts.displacements(pivot).union(&about_fit);
        (parts.load_in(&window, monitor)).map_err(|e| self.scene.pair_error(e))
    }

    /// The pair of a loop ([`DirectOptions::REAL_TIME`]) for poses near the fit, where a hand begins:
    /// on a lattice that gives few enough points, and the whole one unless that is far more
    /// ([`Pair::is_whole`]).
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pair_near_fit(&self, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        self.pair_about_fit(NEAR, monitor)
    }

    /// The same for poses about the fit, `lengths` of the moving part's longest side around it beyond
    /// the scene's window.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pair_about_fit(&self, lengths: f64, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        let at = self.parts.displacements(self.pivot()?).center();
        self.pair_of_loop(at, (lengths, FAR_LESS), monitor)
    }

    /// The same for poses near a displacement of the pivot, metres: as far around it as the scene's
    /// window goes and half the moving part is long.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pair_near(&self, at: DVec3, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        self.pair_of_loop(at, (NEAR, FAR_LESS), monitor)
    }

    /// The same for all poses.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pair_everywhere(&self, monitor: &dyn Monitor) -> Result<Pair, SceneError> {
        self.pair_of_loop(DVec3::ZERO, (0.0, 0.0), monitor)
    }

    /// The same for poses near a displacement, metres: the whole from a share of its bytes on.
    fn pair_of_loop(
        &self,
        at: DVec3,
        (lengths, most): (f64, f64),
        monitor: &dyn Monitor,
    ) -> Result<Pair, SceneError> {
        let few = DirectOptions::REAL_TIME.max_points.unwrap_or(usize::MAX);
        let parts = self.parts.with_points(few);
        let parts = parts.map_err(|e| self.scene.fields_error(e))?;
        let longest = parts.moving.bounds().size().max_element();
        let half = parts.reach() + lengths * longest;
        let near = Aabb::around([at - half, at + half]);
        let pair = parts.load_partly(&near, most, monitor);
        pair.map_err(|e| self.scene.pair_error(e))
    }

    /// The pair as far as poses of the moving shape reach, in groups of near ones
    /// ([`PairSetup::load_at`]).
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn pairs_at(
        &self,
        poses: &[Pose],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Pair, Vec<usize>)>, SceneError> {
        (self.parts.load_at(poses, monitor)).map_err(|e| self.scene.pair_error(e))
    }

    /// The point of the moving shape that its poses are counted by, metres ([`Pair::pivot`]); nothing is
    /// computed.
    ///
    /// # Errors
    /// If the lattices cannot be planned.
    pub fn pivot(&self) -> Result<DVec3, SceneError> {
        let plan = self.parts.plan_unlimited();
        Ok(plan.map_err(|e| self.scene.fields_error(e))?.pivot)
    }

    /// Energies at poses of the shapes by direct quadrature, of which only what they reach is loaded,
    /// when it is asked for.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`], or if a part has no interior on its lattice.
    pub fn tiles(
        &self,
        options: &DirectOptions,
        monitor: &dyn Monitor,
    ) -> Result<TiledEvaluator, SceneError> {
        let tiles = TiledEvaluator::new(&self.parts, options, monitor);
        tiles.map_err(|e| self.tile_error(e))
    }

    /// What went wrong with these, with the scene's file.
    pub fn tile_error(&self, error: TileError) -> SceneError {
        match error {
            TileError::Setup(e) => self.scene.pair_error(e),
            other => SceneError::refused(&self.scene.path, "", other),
        }
    }

    /// What the scene asks of docking: its rotations, if it names any.
    pub fn docking_options(&self) -> DockingRequest {
        DockingRequest {
            rotations: (self.scene.rotations_given).then(|| self.rotations.clone()),
            ..DockingRequest::default()
        }
    }

    /// Looks for the pose where the moving part belongs; the poses found are those of the shapes.
    ///
    /// # Errors
    /// If fields or correlations cannot be had or do not fit in memory, or the monitor cancels before
    /// anything is found.
    pub fn dock(
        &self,
        options: DockingRequest,
        monitor: &dyn Monitor,
    ) -> Result<DockingResult, SceneError> {
        let found = Docking::new(&self.parts, options).run(monitor);
        found.map_err(|e| self.scene.docking_error(e))
    }

    /// Where the scene puts the shapes.
    pub fn placement(&self) -> &Placement {
        &self.parts.placement
    }

    /// The fixed part where the scene puts it.
    pub fn placed_fixed(&self) -> TriangleMesh {
        put(&self.parts.fixed, &self.placement().fixed)
    }

    /// All fixed parts of `scene`, of whose first these parts are, where they stand, in its order.
    ///
    /// # Errors
    /// If a mesh of a further part cannot be read.
    pub fn all_fixed(&self, scene: &Scene) -> Result<Vec<TriangleMesh>, SceneError> {
        let mut placed = vec![self.placed_fixed()];
        for part in &scene.others {
            placed.push(put(&read_part(scene, part, &mut Vec::new())?, &part.pose));
        }
        Ok(placed)
    }

    /// The moving part where `pose`, a pose in the scene, takes it.
    pub fn moving_at(&self, pose: &Pose) -> TriangleMesh {
        put(&self.parts.moving, &(*pose * self.placement().moving))
    }

    /// The box in the scene around both assembled parts, grown by `margin` of its longest side.
    pub fn bounds(&self, margin: f64) -> Aabb {
        let moving = self.moving_at(&self.scene.fit.assembled);
        let both = self.placed_fixed().bounds().union(&moving.bounds());
        both.grown(margin * both.size().max_element())
    }

    /// The unit for reports and pictures: the scene's, but millimetres instead of small fractions of
    /// a metre.
    pub fn display_unit(&self) -> LengthUnit {
        shown_in(self.scene.unit, &self.bounds(0.0))
    }
}

/// The unit for reports on what lies within `bounds`: the scene's, but millimetres instead of small
/// fractions of a metre.
pub(crate) fn shown_in(unit: LengthUnit, bounds: &Aabb) -> LengthUnit {
    match unit {
        LengthUnit::M if bounds.size().max_element() < 0.5 => LengthUnit::Mm,
        unit => unit,
    }
}

fn put(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}

/// What a scene asks of the pair of its first fixed part and the moving one, which have been read;
/// without a cache.
pub(crate) fn pair_setup(
    scene: &Scene,
    fixed: TriangleMesh,
    moving: Arc<TriangleMesh>,
    memory: u64,
) -> PairSetup {
    let lattice = &scene.lattice;
    let placement = scene.placement();
    PairSetup {
        builder: PairBuilder {
            spacing: lattice.step.spacing(&fixed, &moving),
            halo: lattice.halo,
            tolerance: lattice.field_tolerance,
            memory_limit: Some(memory),
            ..PairBuilder::default()
        },
        fixed: Arc::new(fixed),
        moving,
        model: scene.model,
        energy: scene.energy,
        assembled: placement.to_shapes(&scene.fit.assembled),
        center: placement.direction_to_shapes(scene.window.center),
        half_extent: scene.window.half_extent,
        placement,
        cache: None,
    }
}

/// All parts of a scene where they are assembled: fixed ones where the scene puts them, the moving
/// one at the fit. A part of several meshes is one solid.
///
/// ```
/// use pegfit_scene::{PlacedParts, Scene, example_text};
/// use sdf_grid::{mesh_io, shapes::PegInHole};
///
/// # let folder = tempfile::tempdir()?;
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// mesh_io::write_obj(folder.path().join("rectangular_hole.obj"), &hole)?;
/// mesh_io::write_obj(folder.path().join("rectangular_peg.obj"), &peg)?;
/// let text = example_text(PegInHole::Rectangular);
/// let scene = Scene::parse(folder.path().join("scene.toml"), &text)?;
/// let placed = PlacedParts::read(&scene)?;
/// // The fixed part, then the moving one, metres.
/// let volumes: Vec<f64> = placed.parts.iter().map(|(_, mesh)| mesh.volume()).collect();
/// assert!((volumes[1] - peg.volume()).abs() < 1e-12 && volumes.len() == 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PlacedParts {
    /// Names and surfaces, metres: the first fixed part, the other ones, then the moving part.
    pub parts: Vec<(String, Arc<TriangleMesh>)>,
    /// The unit for reports: the scene's, but millimetres instead of small fractions of a metre.
    pub display_unit: LengthUnit,
    /// What the scene's user should know.
    pub warnings: Vec<SceneWarning>,
}

impl PlacedParts {
    /// Reads the meshes of a scene.
    ///
    /// # Errors
    /// If a mesh cannot be used.
    pub fn read(scene: &Scene) -> Result<Self, SceneError> {
        let mut warnings = Vec::new();
        let mut placed = |part: &Part, pose: &Pose| -> Result<_, SceneError> {
            let mesh = read_part(scene, part, &mut warnings)?;
            let mesh = mesh.transformed(pose.rotation, pose.translation);
            Ok((part.name.clone(), Arc::new(mesh)))
        };
        let mut parts = Vec::new();
        for part in scene.fixed_parts() {
            parts.push(placed(part, &part.pose)?);
        }
        let seat = scene.fit.assembled * scene.moving.pose;
        parts.push(placed(&scene.moving, &seat)?);
        let boxes = parts.iter().map(|(_, mesh)| mesh.bounds());
        let bounds = boxes.fold(Aabb::EMPTY, |all, one| all.union(&one));
        Ok(Self {
            display_unit: shown_in(scene.unit, &bounds),
            parts,
            warnings,
        })
    }
}
