//! The density fields of a scene's pair: planned, computed, kept between runs.

use fft_correlate::{Pair, PairBuildError, PairBuilder, PairPlan};
use sdf_grid::{DensityError, FieldCache, TriangleMesh};

use crate::context::Context;
use crate::error::CommandError;
use crate::scene::{LatticeStep, Scene};

/// Lattices, halo and memory of the scene's pair; nothing is computed.
pub(crate) fn plan(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    context: &Context,
) -> Result<PairPlan, CommandError> {
    let spacing = match scene.lattice.step {
        LatticeStep::Spacing(h) => Some(h),
        LatticeStep::Points(n) => {
            let longest = |m: &TriangleMesh| m.bounds().size().max_element();
            Some(longest(fixed).max(longest(moving)) / f64::from(n))
        }
        LatticeStep::Automatic => None,
    };
    let builder = PairBuilder {
        spacing,
        halo: scene.lattice.halo,
        tolerance: scene.lattice.field_tolerance,
        sampling: scene.lattice.sampling,
        deaverage: scene.lattice.deaverage,
        memory_limit: Some(context.memory),
    };
    builder
        .plan(fixed, moving, &scene.model)
        .map_err(|error| explain(scene, error))
}

pub(super) fn compute_pair(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    context: &Context,
) -> Result<Pair, CommandError> {
    let plan = plan(scene, fixed, moving, context)?;
    let cache = FieldCache::new(&scene.cache)
        .map_err(|e| CommandError::failure(format!("{}: cache", scene.path.display()), e))?;
    plan.build_with(fixed, moving, |mesh, kernel, lattice, options| {
        cache.get_or_compute(mesh, kernel, lattice, options, &context.progress)
    })
    .map_err(|error| explain(scene, error))
}

fn explain(scene: &Scene, error: PairBuildError) -> CommandError {
    match error {
        PairBuildError::Memory { needed, limit, .. } => CommandError::Memory {
            what: format!("{}: the density fields", scene.path.display()),
            needed,
            budget: limit,
        },
        PairBuildError::Density {
            source: DensityError::Cancelled,
            ..
        } => CommandError::Interrupted,
        other => CommandError::bad_input(scene.path.display().to_string(), other),
    }
}
