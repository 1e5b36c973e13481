//! Densities on a plane, each part's and their product (figures 4b to 4d).

use fft_correlate::Pose;
use ndarray::Array2;
use num_complex::Complex32;
use pegfit_pictures::{AXES, Slice, density_map, distance_contours, sheet};
use pegfit_scene::Assembly;
use sdf_grid::{
    Aabb, DensityError, DensityField, DensityKernel, DensityOptions, Monitor, Sampling,
    TriangleMesh,
};

use crate::commands::scenes::within;
use crate::context::Context;
use crate::error::CommandError;

/// Samples along the longer side of a picture.
const SAMPLES: usize = 260;

/// A part's density on a plane: computed for the picture, finer than the scene's lattice.
pub(in crate::commands) fn on_plane(
    mesh: &TriangleMesh,
    assembly: &Assembly,
    bounds: &Aabb,
    slice: &Slice,
    monitor: &dyn Monitor,
) -> Result<DensityField, CommandError> {
    let failed = |e| CommandError::bad_input(within(assembly, "density"), e);
    let kernel = DensityKernel::new(assembly.pair.model().sigma)
        .map_err(|e| CommandError::bad_input(within(assembly, "model"), e))?;
    let options = DensityOptions {
        sampling: Sampling::Point,
        ..DensityOptions::default()
    };
    let lattice = slice
        .lattice(bounds, SAMPLES)
        .map_err(|e| CommandError::bad_input(format!("slice {}", AXES[slice.axis]), e))?;
    DensityField::compute(mesh, &kernel, &lattice, &options, monitor).map_err(|e| match e {
        DensityError::Cancelled => CommandError::Interrupted,
        other => failed(other),
    })
}

/// Real and imaginary part of both parts' densities, each where the scene puts it.
pub(in crate::commands) fn densities(
    assembly: &Assembly,
    slice: &Slice,
    context: &Context,
) -> Result<Vec<u8>, CommandError> {
    let model = *assembly.pair.model();
    let unit = assembly.setup.display_unit();
    let (scene, setup) = (assembly.scene(), &assembly.setup);
    let parts = [
        (&scene.fixed.name, setup.placed_fixed()),
        (&scene.moving.name, setup.moving_at(&Pose::IDENTITY)),
    ];
    let bounds = assembly.setup.bounds(0.1);
    let mut maps = Vec::new();
    for (name, mesh) in parts {
        let field = on_plane(&mesh, assembly, &bounds, slice, &context.progress)?;
        let density = field.combined(model.lambda_exterior as f32, model.lambda_interior as f32);
        for (part, values) in [
            ("Re", density.mapv(|v| v.re)),
            ("Im", density.mapv(|v| v.im)),
        ] {
            maps.push(density_map(
                format!("{part} of the density of {name}, {}", slice.label(unit)),
                &format!("{part} ρ\n(no unit)"),
                sheet(&values, &field, slice),
                &field,
                slice,
                unit,
            ));
        }
    }
    context.progress.finish();
    let picture = pegfit_pictures::png("densities", (1500, 1240), |whole| {
        for (panel, map) in whole.split_evenly((2, 2)).iter().zip(&maps) {
            map.draw(panel)?;
        }
        Ok(())
    })?;
    Ok(picture)
}

/// The real part of the product of both densities at the assembled pose: what the score sums.
pub(in crate::commands) fn overlap(
    assembly: &Assembly,
    slice: &Slice,
    context: &Context,
) -> Result<Vec<u8>, CommandError> {
    let unit = assembly.setup.display_unit();
    let bounds = assembly.setup.bounds(0.1);
    let moved = assembly.setup.moving_at(&assembly.assembled());
    let lies = assembly.setup.placed_fixed();
    let fixed = on_plane(&lies, assembly, &bounds, slice, &context.progress)?;
    let moving = on_plane(&moved, assembly, &bounds, slice, &context.progress)?;
    context.progress.finish();
    let mut map = density_map(
        format!("Score density at the assembled pose, {}", slice.label(unit)),
        "Re ρ₁ρ₂\n(no unit)",
        product(assembly, &fixed, &moving, slice),
        &fixed,
        slice,
        unit,
    );
    let other = distance_contours(&moving, slice, unit).0;
    map.contours.push(other);
    for lines in &mut map.contours {
        lines.levels.clear();
    }
    map.note = "lines: the boundaries; red: reward, blue: penalty and separation".to_owned();
    let picture = pegfit_pictures::png("overlap", (1100, 940), |sheet| map.draw(sheet))?;
    Ok(picture)
}

/// `Re [l1 l2 (O1 I2 + I1 O2) + l2² I1 I2 + w l1² O1 O2]` on the plane.
fn product(
    assembly: &Assembly,
    fixed: &DensityField,
    moving: &DensityField,
    slice: &Slice,
) -> Array2<f32> {
    let model = assembly.pair.model();
    let (l1, l2) = (model.lambda_exterior as f32, model.lambda_interior as f32);
    let w = model.separation_weight as f32;
    let o1 = sheet(&fixed.exterior, fixed, slice);
    let i1 = sheet(&fixed.interior, fixed, slice);
    let o2 = sheet(&moving.exterior, moving, slice);
    let i2 = sheet(&moving.interior, moving, slice);
    Array2::from_shape_fn(o1.dim(), |p| {
        let (o1, i1, o2, i2) = (o1[p], i1[p], o2[p], i2[p]);
        let sum: Complex32 =
            (o1 * i2 + i1 * o2) * (l1 * l2) + i1 * i2 * (l2 * l2) + o1 * o2 * (w * l1 * l1);
        sum.re
    })
}
