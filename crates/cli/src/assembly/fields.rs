//! The density fields of a scene's pair: planned, computed, kept between runs.

use fft_correlate::{
    Pair, PairBuildError, PairBuilder, PairPlan, StoreError, TableSpec, TableStore,
};
use sdf_grid::{DensityError, FieldCache, TriangleMesh};

use crate::command::Context;
use crate::error::CommandError;
use crate::scene::{EnergyScale, LatticeStep, Scene};

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

/// The scene on the lattice that a table was baked on, which its tolerance may have chosen, and with
/// the table's energy scale unless the scene states one.
pub(crate) fn as_baked(mut scene: Scene, spec: &TableSpec) -> Scene {
    scene.lattice.step = LatticeStep::Spacing(spec.window.spacing());
    if let Some(field) = &spec.recipe.fixed {
        scene.lattice.sampling = field.sampling;
        scene.lattice.deaverage = spec.recipe.deaverage;
    }
    if let EnergyScale::PeakForce(_) = scene.energy {
        scene.energy = EnergyScale::Gamma(spec.model().gamma);
    }
    scene
}

/// Refuses a table that was not baked from the scene's parts, model and fields; nothing is computed.
pub(crate) fn expect_table_of(
    scene: &Scene,
    [fixed, moving]: [&TriangleMesh; 2],
    store: &TableStore,
    context: &Context,
) -> Result<(), CommandError> {
    let mut scene = as_baked(scene.clone(), store.spec());
    if let EnergyScale::Gamma(gamma) = scene.energy {
        scene.model.gamma = gamma;
    }
    let given = plan(&scene, fixed, moving, context)?
        .recipe(fixed, moving)
        .map_err(|error| explain(&scene, error))?;
    store.expect_recipe(&given).map_err(|error| match error {
        StoreError::Different { path, difference } => CommandError::input(
            scene.path.display().to_string(),
            difference.key,
            format!(
                "that of the table {}, {}",
                path.display(),
                difference.stored
            ),
            difference.given,
        ),
        other => CommandError::bad_input("table", other),
    })
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
        PairBuildError::TooSmall {
            part,
            size,
            spacing,
        } => {
            let (unit, metre) = (scene.unit, scene.unit.in_metres());
            let name = match part {
                "fixed" => &scene.fixed.name,
                _ => &scene.moving.name,
            };
            CommandError::input(
                scene.path.display().to_string(),
                format!("{part} part {name}"),
                format!(
                    "at least a lattice cell of {:.4} {unit} across",
                    spacing / metre
                ),
                format!("{:.3e} {unit}: is it in {unit}?", size / metre),
            )
        }
        other => CommandError::bad_input(scene.path.display().to_string(), other),
    }
}
