//! From a scene to what the libraries work on: solids, how finely, which displacements.

use std::sync::Arc;

use fft_correlate::{PairBuildError, PairBuilder, PairSetup, PairSetupError};
use sdf_grid::{Aabb, FieldCache, LengthUnit, TriangleMesh};

use super::parts::{read_part, warn_of_scale};
use super::types::Scene;
use crate::context::Context;
use crate::error::CommandError;

/// Reads the meshes of a scene with one fixed part and says what is asked of their pair.
///
/// # Errors
/// If the scene has several fixed parts, a mesh cannot be used, or the cache's folder cannot be made.
pub(crate) fn setup(scene: &Scene, context: &Context) -> Result<PairSetup, CommandError> {
    let scene = scene.clone().only(None)?;
    let fixed = read_part(&scene, &scene.fixed, context)?;
    let moving = Arc::new(read_part(&scene, &scene.moving, context)?);
    warn_of_scale(&scene, &fixed, &moving, context);
    setup_of(&scene, fixed, moving, context)
}

/// The same for meshes that have been read.
///
/// # Errors
/// If the cache's folder cannot be made.
pub(crate) fn setup_of(
    scene: &Scene,
    fixed: TriangleMesh,
    moving: Arc<TriangleMesh>,
    context: &Context,
) -> Result<PairSetup, CommandError> {
    let lattice = &scene.lattice;
    let cache = FieldCache::new(&scene.cache)
        .map_err(|e| CommandError::failure(scene.context("cache"), e))?;
    Ok(PairSetup {
        builder: PairBuilder {
            spacing: lattice.step.spacing(&fixed, &moving),
            halo: lattice.halo,
            tolerance: lattice.field_tolerance,
            sampling: lattice.sampling,
            deaverage: lattice.deaverage,
            memory_limit: Some(context.memory),
        },
        fixed: Arc::new(fixed),
        moving,
        model: scene.model,
        energy: scene.energy,
        assembled: scene.fit.assembled,
        center: scene.window.center,
        half_extent: scene.window.half_extent,
        cache: Some(cache),
    })
}

/// What a setup without a pair is to be called.
pub(crate) fn explain(scene: &Scene, error: PairSetupError) -> CommandError {
    match error {
        PairSetupError::Cancelled => CommandError::Interrupted,
        PairSetupError::Build(e) => explain_build(scene, e),
        PairSetupError::Energy(e) => CommandError::bad_input(scene.context("energy"), e),
    }
}

/// What fields that cannot be had are to be called.
pub(crate) fn explain_build(scene: &Scene, error: PairBuildError) -> CommandError {
    match error {
        PairBuildError::Memory { needed, limit, .. } => CommandError::Memory {
            what: scene.context("the density fields"),
            needed,
            budget: limit,
        },
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

/// The box around both parts when assembled, grown by `margin` of its longest side.
pub(crate) fn bounds(setup: &PairSetup, margin: f64) -> Aabb {
    let pose = &setup.assembled;
    let moving = setup.moving.transformed(pose.rotation, pose.translation);
    let both = setup.fixed.bounds().union(&moving.bounds());
    both.grown(margin * both.size().max_element())
}

/// The unit for reports and pictures: the scene's, but millimetres instead of small fractions of a
/// metre.
pub(crate) fn display_unit(scene: &Scene, setup: &PairSetup) -> LengthUnit {
    let longest = bounds(setup, 0.0).size().max_element();
    match scene.unit {
        LengthUnit::M if longest < 0.5 => LengthUnit::Mm,
        unit => unit,
    }
}
