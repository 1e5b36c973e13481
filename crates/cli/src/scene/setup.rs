//! From a scene to what the libraries work on: solids, how finely, which displacements.

use std::sync::Arc;

use fft_correlate::{PairBuildError, PairBuilder, PairSetup, PairSetupError, Pose, RotationDomain};
use sdf_grid::{Aabb, FieldCache, LengthUnit, TriangleMesh};

use super::parts::{read_part, warn_of_scale};
use super::types::Scene;
use crate::context::Context;
use crate::error::CommandError;

/// Reads the meshes of a scene with one fixed part and says what is asked of their pair, in the
/// frames of the shapes.
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
    let placement = scene.placement();
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
        assembled: placement.to_shapes(&scene.fit.assembled),
        center: placement.direction_to_shapes(scene.window.center),
        half_extent: scene.window.half_extent,
        placement,
        cache: Some(cache),
    })
}

/// The rotations that a scene names, as those of the shapes.
///
/// # Errors
/// If one is none.
pub(crate) fn rotations(scene: &Scene) -> Result<RotationDomain, CommandError> {
    let found = scene.rotations.in_shapes(&scene.placement());
    found.map_err(|e| CommandError::bad_input(scene.context("rotations"), e))
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

/// A shape put somewhere.
pub(crate) fn put(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}

/// The box in the scene around both parts when assembled, grown by `margin` of its longest side.
pub(crate) fn bounds(setup: &PairSetup, margin: f64) -> Aabb {
    let fixed = &setup.placement.fixed;
    let moving = put(&setup.moving, &(*fixed * setup.assembled));
    let both = put(&setup.fixed, fixed).bounds().union(&moving.bounds());
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
