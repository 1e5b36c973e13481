//! `pegfit field`: the density field of one mesh, for ParaView and as a picture.

use std::path::PathBuf;
use std::time::Instant;

use pegfit_pictures::{AXES, PictureError, Slice, density_map, sheet, skeleton, write_vti};
use sdf_grid::{
    DensityError, DensityField, DensityKernel, DensityOptions, Lattice, Sampling, TriangleMesh,
    mesh_io,
};
use serde::Serialize;

use crate::args::FieldArgs;
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::memory;
use crate::report::output::{print_json, require_folder};
use sdf_grid::atomic;

/// Samples along the longer side of a slice's picture.
const SAMPLES: usize = 480;

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
    for output in outputs(args) {
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
    let (mesh, report) = mesh_io::read_with(&args.mesh, &args.choice.options(args.unit))?;
    for warning in report.warnings() {
        context.progress.note(&format!("note: {warning}"));
    }
    let task = Task {
        args,
        mesh: &mesh,
        kernel,
        options,
        context,
    };
    let lattice = lattice(args, &mesh)?;
    let mut summary = None;
    if args.output.is_some() || args.skeleton.is_some() {
        let (field, said) = task.compute(&lattice)?;
        summary = Some(said);
        if let Some(path) = &args.output {
            write_vti(path, &field)?;
        }
        if let Some(path) = &args.skeleton {
            atomic::write(path, &task.draw_skeleton(&field)?)?;
        }
    }
    if let (Some(slice), Some(path)) = (slice, &args.png) {
        // Finer than the lattice, but over the same box.
        let bounds = lattice.node_bounds().grown(0.5 * lattice.spacing());
        let plane = slice
            .lattice(&bounds, SAMPLES)
            .map_err(|e| CommandError::bad_input(format!("slice {}", AXES[slice.axis]), e))?;
        let (field, said) = task.compute(&plane)?;
        atomic::write(path, &task.draw_slice(&field, &slice)?)?;
        summary.get_or_insert(said);
    }
    context.progress.finish();
    match summary {
        Some(summary) => report_result(&summary, args, context),
        None => Ok(()),
    }
}

/// The files to write.
fn outputs(args: &FieldArgs) -> impl Iterator<Item = &PathBuf> {
    [&args.output, &args.png, &args.skeleton]
        .into_iter()
        .flatten()
}

/// A mesh and how its field is computed.
struct Task<'a> {
    args: &'a FieldArgs,
    mesh: &'a TriangleMesh,
    kernel: DensityKernel,
    options: DensityOptions,
    context: &'a Context,
}

impl Task<'_> {
    fn compute(&self, lattice: &Lattice) -> Result<(DensityField, Summary), CommandError> {
        let context = self.context;
        let needed = DensityField::memory_bytes(lattice);
        memory::require("the field", needed, context.memory)?;
        let began = Instant::now();
        let (mesh, monitor) = (self.mesh, &context.progress);
        let field = DensityField::compute(mesh, &self.kernel, lattice, &self.options, monitor)
            .map_err(|e| match e {
                DensityError::Cancelled => CommandError::Interrupted,
                other => CommandError::failure(self.args.mesh.display().to_string(), other),
            })?;
        let summary = Summary {
            mesh: self.args.mesh.display().to_string(),
            triangles: self.mesh.triangles().len(),
            nodes: lattice.shape(),
            spacing_m: lattice.spacing(),
            sigma: self.args.sigma,
            seconds: began.elapsed().as_secs_f64(),
            largest_density: largest(&field),
        };
        Ok((field, summary))
    }

    fn part(&self) -> String {
        let stem = self.args.mesh.file_stem().unwrap_or_default();
        match &self.args.choice.solid {
            Some(solid) => format!("{solid} of {}", stem.to_string_lossy()),
            None => stem.to_string_lossy().into_owned(),
        }
    }

    fn draw_slice(&self, field: &DensityField, slice: &Slice) -> Result<Vec<u8>, PictureError> {
        let density = field.combined(1.0, 1.0).mapv(|v| v.im);
        let unit = self.args.unit;
        let map = density_map(
            format!("Density of {}, {}", self.part(), slice.label(unit)),
            "Im density\n(weights 1)",
            sheet(&density, field, slice),
            field,
            slice,
            unit,
        );
        pegfit_pictures::png("density slice", (1100, 900), |sheet| map.draw(sheet))
    }

    fn draw_skeleton(&self, field: &DensityField) -> Result<Vec<u8>, PictureError> {
        let title = format!("Skeleton of {}", self.part());
        let unit = self.args.unit;
        let cloud = skeleton(title, self.mesh, field, &self.kernel, unit);
        pegfit_pictures::png("skeleton", (1100, 900), |sheet| cloud.draw(sheet))
    }
}

/// The plane of the picture; y = 0 if only --png is given.
fn wanted_slice(args: &FieldArgs) -> Result<Option<Slice>, CommandError> {
    if outputs(args).next().is_none() {
        return refuse("--output, --png or --skeleton", "a file to write", "none");
    }
    match (&args.slice, &args.png) {
        (Some(text), Some(_)) => Slice::parse(text, args.unit)
            .map(Some)
            .map_err(CommandError::slice),
        (Some(_), None) => refuse("--png", "a picture file for --slice", "none"),
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
        Some(h) => return refuse("--spacing", "a positive number", h),
        None => longest / DEFAULT_CELLS,
    };
    let margin = match args.margin {
        Some(m) if m.is_finite() && m >= 0.0 => m * metre,
        Some(m) => return refuse("--margin", "a number >= 0", m),
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

fn report_result(
    summary: &Summary,
    args: &FieldArgs,
    context: &Context,
) -> Result<(), CommandError> {
    if context.json {
        return print_json(summary);
    }
    let [nx, ny, nz] = summary.nodes;
    say!(
        "mesh        {}, {} triangles",
        summary.mesh,
        summary.triangles
    );
    say!(
        "lattice     {nx} x {ny} x {nz}, spacing {:.6} {}",
        summary.spacing_m / args.unit.in_metres(),
        args.unit
    );
    say!("computed    in {:.2} s", summary.seconds);
    say!("largest     |density| {:.3}", summary.largest_density);
    for output in outputs(args) {
        say!("wrote       {}", output.display());
    }
    Ok(())
}
