//! `pegfit dock`: the best poses over a scene's whole domain.

use std::path::Path;
use std::time::Instant;

use fft_correlate::{DirectOptions, DockError, DockOptions, DockedPose, Docking, dock};
use serde::Serialize;

use super::{Context, print_json, require_folder};
use crate::args::DockArgs;
use crate::assembly::Assembly;
use crate::atomic;
use crate::error::CommandError;
use crate::poses::{POSE_COLUMNS, pose_fields};
use crate::progress::interrupted;
use crate::scene::Scene;

/// More poses than anybody reads.
const MOST: usize = 100_000;

#[derive(Serialize)]
struct Summary {
    rotations: usize,
    rotations_scored: usize,
    displacements: usize,
    seconds: f64,
    milliseconds_per_rotation: f64,
    poses: Vec<Found>,
}

#[derive(Serialize)]
struct Found {
    position: [f64; 3],
    rotation: [f64; 4],
    energy: f64,
    refined: bool,
    half_width: Option<f64>,
}

pub(super) fn run(args: &DockArgs, context: &Context) -> Result<(), CommandError> {
    if args.top == 0 || args.top > MOST {
        let expected = format!("1 to {MOST}");
        return Err(CommandError::option("--top", expected, args.top));
    }
    let to_stdout = args.output == Path::new("-");
    if !to_stdout {
        require_folder(&args.output)?;
    }
    let assembly = Assembly::load(
        Scene::read(&args.scene)?.only(args.fixed.as_deref())?,
        context,
    )?;
    let began = Instant::now();
    let docking = search(&assembly, args.top, context)?;
    let seconds = began.elapsed().as_secs_f64();
    if !to_stdout {
        atomic::write_with(&args.output, |out| {
            write(&docking, out)
                .map_err(|e| CommandError::failure(args.output.display().to_string(), e))
        })?;
    }
    report(&assembly, &docking, seconds, to_stdout, context)?;
    // What was scored before Ctrl-C has been written; the exit code says that it is not all.
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// Docks over the scene's rotations and window and refines with the direct evaluator.
pub(super) fn search(
    assembly: &Assembly,
    top: usize,
    context: &Context,
) -> Result<Docking, CommandError> {
    let grid = assembly.rotation_grid()?;
    let window = assembly.window()?;
    assembly.require_correlation_memory(&window, context)?;
    let source = assembly.direct(&DirectOptions::FULL)?;
    let mut options = DockOptions::new(&assembly.pair, top);
    options.spacing.symmetries = assembly.symmetry_turns();
    let found = dock(
        &assembly.pair,
        grid.nodes(),
        &window,
        &options,
        Some(&source),
        &context.progress,
    )
    .map_err(|e| match e {
        DockError::Cancelled => CommandError::Interrupted,
        other => CommandError::bad_input(assembly.context("docking"), other),
    })?;
    context.progress.finish();
    Ok(found)
}

fn write(docking: &Docking, out: impl std::io::Write) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    let more = ["energy", "half_width", "refined"];
    rows.write_record(POSE_COLUMNS.iter().chain(&more))?;
    for found in &docking.poses {
        for value in pose_fields(&found.pose) {
            rows.write_field(value.to_string())?;
        }
        rows.write_field(found.energy.to_string())?;
        rows.write_field(found.half_width.to_string())?;
        rows.write_field(found.refined.to_string())?;
        rows.write_record(None::<&[u8]>)?;
    }
    Ok(rows.flush()?)
}

fn report(
    assembly: &Assembly,
    docking: &Docking,
    seconds: f64,
    to_stdout: bool,
    context: &Context,
) -> Result<(), CommandError> {
    let per_rotation = 1e3 * seconds / docking.scored.max(1) as f64;
    if context.json {
        return print_json(&Summary {
            rotations: docking.rotations,
            rotations_scored: docking.scored,
            displacements: assembly.window()?.lattice().len(),
            seconds,
            milliseconds_per_rotation: per_rotation,
            poses: docking.poses.iter().map(found).collect(),
        });
    }
    if to_stdout {
        return write(docking, std::io::stdout().lock())
            .map_err(|e| CommandError::failure("writing standard output", e));
    }
    crate::say!(
        "scored {} of {} rotations in {seconds:.2} s, {per_rotation:.1} ms each",
        docking.scored,
        docking.rotations
    );
    let unit = assembly.display_unit();
    let metre = unit.in_metres();
    crate::say!("  energy (mJ)   from the fit ({unit}, degrees)");
    for pose in docking.poses.iter().take(10) {
        let (shift, turn) = assembly.from_fit(&pose.pose);
        crate::say!(
            "  {:>11.4}   {:>9.4}  {:>8.3}",
            1e3 * pose.energy,
            shift / metre,
            turn.to_degrees()
        );
    }
    Ok(())
}

fn found(pose: &DockedPose) -> Found {
    Found {
        position: pose.pose.translation.to_array(),
        rotation: pose.pose.rotation.to_array(),
        energy: pose.energy,
        refined: pose.refined,
        // JSON has no infinity.
        half_width: Some(pose.half_width).filter(|w| w.is_finite()),
    }
}
