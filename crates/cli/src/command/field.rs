//! `pegfit field`: the density field of one mesh, for ParaView and as a picture.

use std::time::Instant;

use sdf_grid::{
    DensityError, DensityField, DensityKernel, DensityOptions, HygieneOptions, Lattice, Sampling,
    TriangleMesh, mesh_io,
};
use serde::Serialize;

use super::{Context, print_json, require_folder};
use crate::args::FieldArgs;
use crate::error::CommandError;
use crate::slice::Slice;
use crate::{atomic, figure, memory, picture, vti};

/// Lattice cells along the longest side unless --spacing says otherwise.
const DEFAULT_CELLS: f64 = 48.0;

#[derive(Serialize)]
struct Summary {
    mesh: String,
    triangles: usize,
    nodes: [usize; 3],
    spacing_m: f64,
    sigma: f64,
    seconds: f64,
    largest_density: f64,
}

pub(super) fn run(args: &FieldArgs, context: &Context) -> Result<(), CommandError> {
    let slice = wanted_slice(args)?;
    for output in [&args.output, &args.png].into_iter().flatten() {
        require_folder(output)?;
    }
    let kernel = DensityKernel::new(args.sigma)
        .map_err(|e| CommandError::bad_input("command line: --sigma", e))?;
    let options = DensityOptions {
        tolerance: args.tolerance,
        sampling: Sampling::Point,
        ..DensityOptions::default()
    };
    options
        .validate()
        .map_err(|e| CommandError::bad_input("command line", e))?;
    let (mesh, report) = mesh_io::read(&args.mesh, args.unit, &HygieneOptions::default())?;
    for warning in report.warnings() {
        context.progress.note(&format!("note: {warning}"));
    }
    let lattice = lattice(args, &mesh)?;
    memory::require(
        "the field",
        DensityField::memory_bytes(&lattice),
        context.memory,
    )?;
    let began = Instant::now();
    let field = DensityField::compute(&mesh, &kernel, &lattice, &options, &context.progress)
        .map_err(|e| match e {
            DensityError::Cancelled => CommandError::Interrupted,
            other => CommandError::failure(args.mesh.display().to_string(), other),
        })?;
    let seconds = began.elapsed().as_secs_f64();
    context.progress.finish();
    if let Some(path) = &args.output {
        vti::write(path, &field)?;
    }
    if let (Some(slice), Some(path)) = (slice, &args.png) {
        atomic::write(path, &draw(args, &field, &slice)?)?;
    }
    report_result(
        &Summary {
            mesh: args.mesh.display().to_string(),
            triangles: mesh.triangles().len(),
            nodes: lattice.shape(),
            spacing_m: lattice.spacing(),
            sigma: args.sigma,
            seconds,
            largest_density: largest(&field),
        },
        args,
        context,
    )
}

/// The plane of the picture; y = 0 if only --png is given.
fn wanted_slice(args: &FieldArgs) -> Result<Option<Slice>, CommandError> {
    if args.output.is_none() && args.png.is_none() {
        return Err(CommandError::option(
            "--output, --png",
            "a file to write",
            "neither",
        ));
    }
    match (&args.slice, &args.png) {
        (Some(text), Some(_)) => Slice::parse(text, args.unit).map(Some),
        (Some(_), None) => Err(CommandError::option(
            "--png",
            "a picture file for --slice",
            "none",
        )),
        (None, Some(_)) => Ok(Some(Slice { axis: 1, at: 0.0 })),
        (None, None) => Ok(None),
    }
}

fn lattice(args: &FieldArgs, mesh: &TriangleMesh) -> Result<Lattice, CommandError> {
    let metre = args.unit.in_metres();
    let bounds = mesh.bounds();
    let longest = bounds.size().max_element();
    let spacing = match args.spacing {
        Some(h) if h.is_finite() && h > 0.0 => h * metre,
        Some(h) => return Err(CommandError::option("--spacing", "a positive number", h)),
        None => longest / DEFAULT_CELLS,
    };
    let margin = match args.margin {
        Some(m) if m.is_finite() && m >= 0.0 => m * metre,
        Some(m) => return Err(CommandError::option("--margin", "a number >= 0", m)),
        None => 0.25 * longest,
    };
    Lattice::covering(&bounds, margin, spacing)
        .map_err(|e| CommandError::bad_input("command line: --spacing", e))
}

fn largest(field: &DensityField) -> f64 {
    field
        .exterior
        .iter()
        .chain(&field.interior)
        .map(|v| f64::from(v.norm()))
        .fold(0.0, f64::max)
}

fn draw(args: &FieldArgs, field: &DensityField, slice: &Slice) -> Result<Vec<u8>, CommandError> {
    let density = field.combined(1.0, 1.0).mapv(|v| v.im);
    let map = figure::density_map(
        format!(
            "Density of {}, imaginary part, {}",
            args.mesh
                .file_stem()
                .map(|s| s.to_string_lossy())
                .unwrap_or_default(),
            slice.label(args.unit)
        ),
        "Im density\n(unit weights)",
        figure::sheet(&density, field, slice),
        field,
        slice,
        args.unit,
    );
    picture::png("density slice", (1100, 900), |sheet| map.draw(sheet))
}

fn report_result(
    summary: &Summary,
    args: &FieldArgs,
    context: &Context,
) -> Result<(), CommandError> {
    if context.json {
        return print_json(summary);
    }
    let [nx, ny, nz] = summary.nodes;
    crate::say!(
        "mesh        {}, {} triangles",
        summary.mesh,
        summary.triangles
    );
    crate::say!(
        "lattice     {nx} x {ny} x {nz}, spacing {:.6} {}",
        summary.spacing_m / args.unit.in_metres(),
        args.unit
    );
    crate::say!("computed    in {:.2} s", summary.seconds);
    crate::say!("largest     |density| {:.3}", summary.largest_density);
    for output in [&args.output, &args.png].into_iter().flatten() {
        crate::say!("wrote       {}", output.display());
    }
    Ok(())
}
