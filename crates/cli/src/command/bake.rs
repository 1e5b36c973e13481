//! `pegfit bake`: the SE(3) table of a scene.

use std::path::Path;
use std::time::Instant;

use fft_correlate::bake::{BakeError, BakeReport, Share, bake};
use fft_correlate::launcher::Launcher;
use fft_correlate::store::{ChunkState, StoreError, TableStore};
use fft_correlate::table_error::{ErrorReport, measure_error};
use fft_correlate::{DirectOptions, EnergyTable};
use serde::Serialize;

use super::{Context, print_json};
use crate::args::BakeArgs;
use crate::assembly::Assembly;
use crate::error::CommandError;
use crate::memory::display_bytes;
use crate::scene::Scene;

/// Held-out poses on which a finished table is compared with the direct evaluator.
const POSES: usize = 1000;

/// Seed of those poses.
const SEED: u64 = 1;

/// How much of a table is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
struct Progress {
    rotations: usize,
    finished: usize,
    missing: usize,
    damaged: usize,
}

#[derive(Serialize)]
struct Summary {
    table: String,
    rotations: usize,
    computed: usize,
    repaired: usize,
    kept: usize,
    seconds: f64,
    bytes: u64,
    complete: bool,
    error: Option<ErrorReport>,
}

pub(super) fn run(args: &BakeArgs, context: &Context) -> Result<(), CommandError> {
    if args.status {
        return status(args, context);
    }
    let share = share(args)?;
    super::require_folder(&args.output)?;
    let assembly = Assembly::load(
        Scene::read(&args.scene)?.only(args.fixed.as_deref())?,
        context,
    )?;
    let began = Instant::now();
    let spec = assembly.table_spec()?;
    let energies = assembly.energies(context)?;
    let report = bake(&args.output, &spec, &energies, share, &context.progress)
        .map_err(|e| explain(&args.output, e))?;
    context.progress.finish();
    let seconds = began.elapsed().as_secs_f64();
    let mut store = open(&args.output)?;
    let progress = examine(&store)?;
    let complete = progress.finished == progress.rotations;
    // Of several processes, the one that finds the table whole measures its error.
    let error = match complete {
        true => Some(measure(&mut store, &assembly, context)?),
        false => None,
    };
    let summary = summary(args, &report, &store, seconds, error);
    if context.json {
        return print_json(&summary);
    }
    print(&summary, &progress);
    Ok(())
}

/// The options, else the launcher's environment, else all of it.
fn share(args: &BakeArgs) -> Result<Share, CommandError> {
    let (rank, size) = match (args.rank, args.size) {
        (Some(rank), Some(size)) => (rank, size),
        (Some(_), None) => {
            return Err(CommandError::option("--size", "given with --rank", "none"));
        }
        (None, size) => {
            let found = Launcher::from_env(size)
                .map_err(|e| CommandError::bad_input("launcher's environment", e))?;
            match (found, size) {
                (Some(launcher), _) => (launcher.rank, launcher.size),
                (None, Some(size)) if size != 1 => {
                    return Err(CommandError::option("--rank", "given with --size", "none"));
                }
                (None, _) => (0, 1),
            }
        }
    };
    if rank >= size {
        return Err(CommandError::option(
            "--rank",
            format!("below --size {size}"),
            rank,
        ));
    }
    Ok(Share {
        rank,
        size,
        resume: args.resume,
    })
}

fn status(args: &BakeArgs, context: &Context) -> Result<(), CommandError> {
    // The scene is read so that a mistake in it is found before the bake, not after.
    Scene::read(&args.scene)?;
    let progress = examine(&open(&args.output)?)?;
    if context.json {
        return print_json(&progress);
    }
    crate::say!(
        "{}: {} of {} rotations finished, {} missing, {} damaged",
        args.output.display(),
        progress.finished,
        progress.rotations,
        progress.missing,
        progress.damaged
    );
    Ok(())
}

fn examine(store: &TableStore) -> Result<Progress, CommandError> {
    let rotations = store.grid().nodes().len();
    let mut progress = Progress {
        rotations,
        finished: 0,
        missing: 0,
        damaged: 0,
    };
    for row in 0..rotations {
        let state = store
            .state(row)
            .map_err(|e| CommandError::failure(store.path().display().to_string(), e))?;
        match state {
            ChunkState::Finished => progress.finished += 1,
            ChunkState::Missing => progress.missing += 1,
            ChunkState::Damaged(_) => progress.damaged += 1,
        }
    }
    Ok(progress)
}

fn measure(
    store: &mut TableStore,
    assembly: &Assembly,
    context: &Context,
) -> Result<ErrorReport, CommandError> {
    let table = load(store, context)?;
    let truth = assembly.direct(&DirectOptions::FULL)?;
    let report = measure_error(&table, &truth, POSES, SEED);
    store
        .write_error_report(&report)
        .map_err(|e| CommandError::failure(store.path().display().to_string(), e))?;
    Ok(report)
}

/// Opens the table at `path`.
pub(super) fn open(path: &Path) -> Result<TableStore, CommandError> {
    TableStore::open(path).map_err(bad_table)
}

/// Reads all of a table into memory.
pub(super) fn load(store: &TableStore, context: &Context) -> Result<EnergyTable, CommandError> {
    store.load(context.memory).map_err(bad_table)
}

fn bad_table(error: StoreError) -> CommandError {
    CommandError::bad_input("table", error)
}

/// What a failed bake is to be called.
pub(super) fn explain(path: &Path, error: BakeError) -> CommandError {
    match error {
        BakeError::Cancelled => CommandError::Interrupted,
        BakeError::Exists { .. } => CommandError::input(
            path.display().to_string(),
            "table",
            "nothing, or --resume to go on with it",
            "a table",
        ),
        other => CommandError::bad_input(path.display().to_string(), other),
    }
}

fn summary(
    args: &BakeArgs,
    report: &BakeReport,
    store: &TableStore,
    seconds: f64,
    error: Option<ErrorReport>,
) -> Summary {
    Summary {
        table: args.output.display().to_string(),
        rotations: report.rotations,
        computed: report.computed,
        repaired: report.repaired,
        kept: report.kept,
        seconds,
        bytes: store.spec().bytes(report.rotations) as u64,
        complete: error.is_some(),
        error,
    }
}

fn print(summary: &Summary, progress: &Progress) {
    crate::say!(
        "{}: {} of {} rotations, {} in memory",
        summary.table,
        progress.finished,
        summary.rotations,
        display_bytes(summary.bytes)
    );
    crate::say!(
        "computed {} rotations in {:.2} s ({:.1} ms each), {} were there, {} of them damaged",
        summary.computed,
        summary.seconds,
        1e3 * summary.seconds / summary.computed.max(1) as f64,
        summary.kept + summary.repaired,
        summary.repaired
    );
    let Some(error) = &summary.error else {
        crate::say!("not complete yet: its error is measured when it is");
        return;
    };
    crate::say!(
        "against direct evaluation at {} held-out poses (rms of the difference / rms):",
        error.poses
    );
    for (name, e) in [
        ("energy", &error.energy),
        ("force", &error.force),
        ("torque", &error.torque),
    ] {
        crate::say!(
            "  {name:<7} {:>7.3} %, worst {:>7.2} %",
            100.0 * e.rms / e.scale,
            100.0 * e.worst / e.scale
        );
    }
}
