//! `pegfit bake`: the SE(3) table of a scene.

use std::path::Path;
use std::time::Instant;

use fft_correlate::{
    BakeResult, EnergyTable, ErrorReport, FieldNodes, Share, Storage, TableFiles, TablePlan,
    TableSpec, TableStore, bake,
};
use pegfit_scene::{Scene, SceneSetup, TableReference, held_out_poses};
use serde::Serialize;

use super::worker_share::{Batch, WorkerShare};
use super::{scenes, stored, tolerance};
use crate::args::BakeArgs;
use crate::bytes::display_bytes;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::require_folder;

/// What is shared.
const BATCH: Batch = Batch {
    does: "bakes",
    all: "all of the table",
};

#[derive(Serialize)]
struct Summary {
    table: String,
    share: WorkerShare,
    rotations: usize,
    computed: usize,
    repaired: usize,
    kept: usize,
    /// Of the rotations computed now.
    bricks: usize,
    bricks_left_out: usize,
    seconds: f64,
    /// In memory, if nothing were left out.
    bytes_dense: u64,
    /// In memory.
    bytes: u64,
    bytes_on_disk: u64,
    /// Metres.
    spacing: f64,
    /// Nodes of both lattices: computed, since in reach of the window, and in all.
    nodes: FieldNodes,
    complete: bool,
    error: Option<ErrorReport>,
}

pub(super) fn run(args: &BakeArgs, context: &Context) -> Result<(), CommandError> {
    if args.status {
        return status(args, context);
    }
    let part = WorkerShare::of(args.rank, args.size, &BATCH)?;
    part.note(context);
    require_place(&args.output)?;
    let (design, reference) = prepare(args, context)?;
    let began = Instant::now();
    let spec = TableSpec {
        storage: storage(args),
        ..design.table.spec.clone()
    };
    let energies = design.setup.energies(&design.table)?;
    let share = Share {
        rank: part.rank,
        size: part.size,
        resume: args.resume,
    };
    let report = bake(&args.output, &spec, &energies, share, &context.progress)
        .map_err(|e| stored::bake_error(&args.output, e))?;
    context.progress.finish();
    let seconds = began.elapsed().as_secs_f64();
    let mut store = stored::open(&args.output)?;
    let progress = stored::examine(&store, context)?;
    let mut summary = summary(
        args,
        part,
        &report,
        &store,
        (seconds, design.table.pair.nodes()),
    )?;
    // Of several processes, the one that finds the table whole measures its error.
    if progress.finished == progress.rotations {
        let table = stored::load(&store, context)?;
        summary.bytes = table.memory();
        let poses = args.poses.unwrap_or_else(|| held_out_poses(args.tolerance));
        let error = measure(&mut store, &table, &design, reference, poses)?;
        summary.error = Some(error);
        summary.complete = true;
    }
    context.show(&summary, || print(&summary, &progress))?;
    let rotations = &store.spec().rotations;
    let reached = summary.error.as_ref().map(|e| e.wrench(rotations));
    check_tolerance(args, reached)
}

/// A scene and its table.
struct Design {
    setup: SceneSetup,
    table: TablePlan,
}

fn storage(args: &BakeArgs) -> Storage {
    Storage {
        leave_out: args.leave_out,
    }
}

/// The table as it is to be baked, and, where a tolerance was asked for, what its error is measured
/// against. A table that is already there has chosen.
fn prepare(
    args: &BakeArgs,
    context: &Context,
) -> Result<(Design, Option<TableReference>), CommandError> {
    let scene = scenes::read(&args.scene.file, args.scene.fixed.as_deref())?;
    let mut setup = scenes::setup(scene, context)?;
    let mut reference = None;
    let chosen = args.tolerance.is_some() && exists(&args.output)?;
    if let (Some(tolerance), false) = (args.tolerance, chosen) {
        let found = tolerance::choose(&setup, tolerance, context)?;
        let reference = TableReference {
            truth: found.reference,
            spacing: found.reference_spacing,
        };
        let table = found.plan;
        return Ok((Design { setup, table }, Some(reference)));
    }
    if chosen {
        let store = stored::open(&args.output)?;
        setup.expect_table(&store)?;
        let spacing = 0.5 * store.spec().window.spacing();
        let (found, _) = setup.reference(store.spec(), Some(spacing), &context.progress)?;
        reference = Some(found);
        setup = setup.as_baked(store.spec());
    }
    let pair = setup.pair_in_window(&context.progress)?;
    context.progress.finish();
    let table = setup.design(pair)?;
    Ok((Design { setup, table }, reference))
}

/// Checks that the folder of a table to be exists; object stores have no folders.
fn require_place(output: &Path) -> Result<(), CommandError> {
    let files = TableFiles::at(output).map_err(CommandError::table)?;
    if TableFiles::is_remote(output) {
        return Ok(());
    }
    require_folder(files.place())
}

fn exists(output: &Path) -> Result<bool, CommandError> {
    let files = TableFiles::at(output).map_err(CommandError::table)?;
    files.exist().map_err(CommandError::table)
}

/// The probes may have promised too much.
fn check_tolerance(args: &BakeArgs, reached: Option<f64>) -> Result<(), CommandError> {
    match (args.tolerance, reached) {
        (Some(asked), Some(reached)) if reached > asked => Err(CommandError::tolerance(
            "the whole table",
            [asked, reached],
            "though its probes did; it is kept. Ask for a little less, or more poses",
        )),
        _ => Ok(()),
    }
}

fn status(args: &BakeArgs, context: &Context) -> Result<(), CommandError> {
    // The scene is read so that a mistake in it is found before the bake, not after.
    Scene::read(&args.scene.file)?;
    let store = stored::open(&args.output)?;
    let progress = stored::examine(&store, context)?;
    context.show(&progress, || {
        say!(
            "{}: {} of {} rotations finished, {} missing, {} damaged",
            args.output.display(),
            progress.finished,
            progress.rotations,
            progress.missing,
            progress.damaged
        );
    })?;
    stored::expect_whole(&store, &progress)
}

fn measure(
    store: &mut TableStore,
    table: &EnergyTable,
    design: &Design,
    reference: Option<TableReference>,
    poses: usize,
) -> Result<ErrorReport, CommandError> {
    let pair = &design.table.pair;
    let reference = match reference {
        Some(reference) => reference,
        None => design.setup.reference_on(pair)?,
    };
    let report = reference.measure(table, pair, poses, stored::SEED);
    store
        .write_error_report(&report)
        .map_err(|e| CommandError::failure(store.path().display().to_string(), e))?;
    Ok(report)
}

fn summary(
    args: &BakeArgs,
    share: WorkerShare,
    report: &BakeResult,
    store: &TableStore,
    (seconds, nodes): (f64, FieldNodes),
) -> Result<Summary, CommandError> {
    let bytes_dense = u64::try_from(store.spec().bytes(report.rotations)).unwrap_or(u64::MAX);
    Ok(Summary {
        table: args.output.display().to_string(),
        share,
        rotations: report.rotations,
        computed: report.computed,
        repaired: report.repaired,
        kept: report.kept,
        bricks: report.bricks,
        bricks_left_out: report.bricks_left_out,
        seconds,
        bytes_dense,
        bytes: bytes_dense,
        bytes_on_disk: store
            .bytes_on_disk()
            .map_err(|e| CommandError::failure("table", e))?,
        spacing: store.spec().window.spacing(),
        nodes,
        complete: false,
        error: None,
    })
}

fn print(summary: &Summary, progress: &stored::Progress) {
    say!(
        "{}: {} of {} rotations, {} in memory, {} on disk",
        summary.table,
        progress.finished,
        summary.rotations,
        display_bytes(summary.bytes),
        display_bytes(summary.bytes_on_disk)
    );
    say!(
        "computed {} rotations in {:.2} s ({:.1} ms each), {} were there, {} of them damaged",
        summary.computed,
        summary.seconds,
        1e3 * summary.seconds / summary.computed.max(1) as f64,
        summary.kept + summary.repaired,
        summary.repaired
    );
    say!(
        "left out {} of {} bricks, which hold nothing of note: {} less on disk than plain numbers, {} less in memory",
        summary.bricks_left_out,
        summary.bricks,
        display_bytes(summary.bytes_dense.saturating_sub(summary.bytes_on_disk)),
        display_bytes(summary.bytes_dense.saturating_sub(summary.bytes))
    );
    let FieldNodes { computed, whole } = summary.nodes;
    if computed < whole {
        say!("densities at {computed} of {whole} nodes: what the window reaches");
    }
    if let Some(told) = summary.share.description() {
        say!("{told}");
    }
    match &summary.error {
        None => say!("not complete yet: its error is measured when it is"),
        Some(error) => stored::print_error(error),
    }
}
