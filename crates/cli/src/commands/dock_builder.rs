//! What a search works on: the parts in a frame that suits it, on its lattices.

use fft_correlate::{
    Pair, PairBuilder, PairPlan, Pose, RotationDomain, SearchDomain, SearchLattices,
    domain_rotations, symmetry_group,
};
use glam::{DQuat, DVec3};
use sdf_grid::{Aabb, FieldCache, TriangleMesh, snug_rotation};

use crate::context::Context;
use crate::scene::Assembly;
use crate::error::CommandError;
use crate::terminal::progress::interrupted;
use crate::scene::{LatticeStep, Scene};

/// Angle between rotations of a scene that names none, degrees.
const STEP_DEG: f64 = 15.0;

/// The lattice of a scene that names none is the fine one of the search, whose fields are needed anyway.
pub(super) fn choose_lattice(scene: &mut Scene, moving: &TriangleMesh) {
    if scene.lattice.step == LatticeStep::Automatic {
        let lattices = SearchLattices::new(moving);
        scene.lattice.step = LatticeStep::Spacing(lattices.fine);
        scene.lattice.halo.get_or_insert(lattices.halo);
    }
}

/// How the fixed part is turned for a search, so that it fills its box along the axes: lattices and
/// transforms become smaller. A scene that says where to look is looked at in its own frame. The moving part
/// stays as it is: with lattices that lie parallel, errors at touching faces add up (`docs/docking.md`).
fn frame(assembly: &Assembly) -> Pose {
    let rotation = match assembly.scene.window.half_extent {
        Some(_) => DQuat::IDENTITY,
        None => snug_rotation(&assembly.fixed),
    };
    Pose::new(rotation, DVec3::ZERO)
}

/// The parts of a scene on the lattices of a search. A spacing or halo that the scene gives is kept
/// for the fine one.
pub(super) struct Builder<'a> {
    assembly: &'a Assembly,
    context: &'a Context,
    /// From the fixed part's own frame to that of the search.
    frame: Pose,
    /// In the latter.
    fixed: TriangleMesh,
    pub(super) lattices: SearchLattices,
    builder: PairBuilder,
    cache: FieldCache,
}

impl<'a> Builder<'a> {
    pub(super) fn new(assembly: &'a Assembly, context: &'a Context) -> Result<Self, CommandError> {
        let scene = &assembly.scene;
        let frame = frame(assembly);
        let fixed = assembly
            .fixed
            .transformed(frame.rotation, frame.translation);
        let mut lattices = SearchLattices::new(&assembly.moving);
        if scene.lattice.step != LatticeStep::Automatic {
            lattices.fine = assembly.pair.spacing();
            lattices.coarse = lattices.coarse.max(lattices.fine);
        }
        if let Some(halo) = scene.lattice.halo {
            lattices.halo = halo;
        }
        let builder = PairBuilder {
            tolerance: scene.lattice.field_tolerance,
            sampling: scene.lattice.sampling,
            deaverage: scene.lattice.deaverage,
            memory_limit: Some(context.memory),
            ..PairBuilder::default()
        };
        let cache = FieldCache::new(&scene.cache)
            .map_err(|e| CommandError::failure(assembly.context("cache"), e))?;
        Ok(Self {
            assembly,
            context,
            frame,
            fixed,
            lattices,
            builder,
            cache,
        })
    }

    /// Of the sketch, the coarse and the fine pair.
    pub(super) fn plans(&self) -> Result<[PairPlan; 3], CommandError> {
        let (fixed, moving) = (&self.fixed, &self.assembly.moving);
        let model = self.assembly.pair.model();
        let plans = self.lattices.plans(fixed, moving, model, &self.builder);
        plans.map_err(|e| self.bad(e))
    }

    /// The pair on half the fine spacing; none, with a remark, if it cannot be had.
    pub(super) fn deciding(&self) -> Result<Option<Pair>, CommandError> {
        let (fixed, moving) = (&self.fixed, &self.assembly.moving);
        let model = self.assembly.pair.model();
        let plan = self
            .lattices
            .deciding_plan(fixed, moving, model, &self.builder);
        match plan {
            Ok(plan) => self.build(&plan).map(Some),
            Err(reason) => {
                crate::remark!("poses of nearly equal depth are not looked at closer: {reason}");
                Ok(None)
            }
        }
    }

    pub(super) fn build(&self, plan: &PairPlan) -> Result<Pair, CommandError> {
        let (fixed, moving) = (&self.fixed, &self.assembly.moving);
        plan.build_with(fixed, moving, |mesh, kernel, lattice, options| {
            self.cache
                .get_or_compute(mesh, kernel, lattice, options, &self.context.progress)
        })
        .map_err(|e| match interrupted() {
            true => CommandError::Interrupted,
            false => self.bad(e),
        })
    }

    /// A pose in the parts' own frames, given that of a search.
    pub(super) fn own(&self, pose: &Pose) -> Pose {
        self.frame.inverse() * *pose
    }

    /// Where to look.
    pub(super) fn domain(&self) -> Result<SearchDomain, CommandError> {
        let assembly = self.assembly;
        let scene = &assembly.scene;
        let everywhere = RotationDomain::full(STEP_DEG);
        let rotations = match scene.rotations_given {
            true => &scene.rotations,
            false => &everywhere,
        };
        let axes = &assembly.moving_symmetry;
        let bad = |e| CommandError::bad_input(assembly.context("rotations"), e);
        let (rotations, step) = match rotations {
            // All of them: evenly in this frame, where most work is shared.
            RotationDomain::Full { .. } => domain_rotations(rotations, axes).map_err(bad)?,
            domain => {
                let (rotations, step) = domain_rotations(domain, axes).map_err(bad)?;
                let turned = rotations.into_iter().map(|q| self.frame.rotation * q);
                (turned.collect(), step)
            }
        };
        let places = match scene.window.half_extent {
            Some(half) => {
                let middle = scene.window.center + assembly.assembled().apply(self.lattices.pivot);
                Aabb {
                    min: middle - half,
                    max: middle + half,
                }
            }
            None => self.lattices.places(&self.fixed.bounds()),
        };
        Ok(SearchDomain {
            rotations,
            step,
            places,
            symmetries: symmetry_group(axes),
        })
    }

    pub(super) fn bad(
        &self,
        error: impl std::error::Error + Send + Sync + 'static,
    ) -> CommandError {
        CommandError::bad_input(self.assembly.context("docking"), error)
    }
}
