//! A table that is there: opened, read, examined, its errors told and compared with the truth.

use std::path::Path;

use fft_correlate::table::{ChunkState, TableSetupError};
use fft_correlate::{
    BakeError, DirectEvaluator, DirectOptions, EnergyTable, ErrorReport, Pair, PairSetup,
    StoreError, TableStore,
};
use rayon::prelude::*;
use serde::Serialize;

use crate::context::Context;
use crate::error::CommandError;
use crate::scene::{Scene, explain_build, setup};

/// Seed of the held-out poses on which a finished table is compared with the direct evaluator.
pub(super) const SEED: u64 = 1;

/// At how many of these poses the condition number of the score is found, cell by cell.
pub(super) const CONDITION_POSES: usize = 32;

/// How much of a table is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Progress {
    pub(super) rotations: usize,
    pub(super) finished: usize,
    pub(super) missing: usize,
    pub(super) damaged: usize,
}

/// Opens the table at `path`.
pub(super) fn open(path: &Path) -> Result<TableStore, CommandError> {
    TableStore::open(path).map_err(bad_table)
}

/// Reads all of a table into memory.
pub(super) fn load(store: &TableStore, context: &Context) -> Result<EnergyTable, CommandError> {
    store.load(context.memory).map_err(bad_table)
}

pub(super) fn bad_table(error: StoreError) -> CommandError {
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
        // The disk is at fault, not the input.
        BakeError::Store(e @ StoreError::Io { .. }) => CommandError::failure("baking", e),
        other => CommandError::bad_input(path.display().to_string(), other),
    }
}

pub(super) fn examine(store: &TableStore) -> Result<Progress, CommandError> {
    let rotations = store.grid().nodes().len();
    let states: Vec<ChunkState> = (0..rotations)
        .into_par_iter()
        .map(|row| store.state(row))
        .collect::<Result<_, _>>()
        .map_err(|e| CommandError::failure(store.path().display().to_string(), e))?;
    let count = |kind: fn(&ChunkState) -> bool| states.iter().filter(|s| kind(s)).count();
    Ok(Progress {
        rotations,
        finished: count(|s| matches!(s, ChunkState::Finished)),
        missing: count(|s| matches!(s, ChunkState::Missing)),
        damaged: count(|s| matches!(s, ChunkState::Damaged(_))),
    })
}

/// Refuses a table that was not baked from the scene's parts, model and fields; nothing is computed.
pub(super) fn expect_scene(
    store: &TableStore,
    scene: &Scene,
    context: &Context,
) -> Result<(), CommandError> {
    expect_setup(store, scene, &setup(scene, context)?)
}

/// The same for parts that have been read.
pub(super) fn expect_setup(
    store: &TableStore,
    scene: &Scene,
    read: &PairSetup,
) -> Result<(), CommandError> {
    store.expect_setup(read).map_err(|error| match error {
        TableSetupError::Build(e) => explain_build(scene, e),
        TableSetupError::Store(StoreError::Different { path, difference }) => CommandError::input(
            scene.path.display().to_string(),
            difference.key,
            format!(
                "that of the table {}, {}",
                path.display(),
                difference.stored
            ),
            difference.given,
        ),
        TableSetupError::Store(other) => bad_table(other),
    })
}

/// The evaluator that a table's error is measured against, direct quadrature on densities of
/// `spacing` (0: the table's own), with the table's sampling and energy scale; and the pair that it
/// evaluates.
pub(super) fn reference(
    store: &TableStore,
    scene: &Scene,
    read: &PairSetup,
    spacing: f64,
    context: &Context,
) -> Result<(DirectEvaluator, Pair), CommandError> {
    let mut setup = read.as_baked(store.spec());
    if spacing > 0.0 {
        setup.builder.spacing = Some(spacing);
    }
    let pair = load_pair(scene, &setup, context)?;
    let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)
        .map_err(|e| CommandError::bad_input(scene.path.display().to_string(), e))?;
    Ok((source, pair))
}

/// A setup's pair, with its energy scale.
pub(super) fn load_pair(
    scene: &Scene,
    setup: &PairSetup,
    context: &Context,
) -> Result<Pair, CommandError> {
    let pair = setup
        .load(&context.progress)
        .map_err(|e| crate::scene::explain(scene, e))?;
    context.progress.finish();
    Ok(pair)
}

/// The errors that a table states, as shares of each quantity's rms.
pub(super) fn print_error(report: &ErrorReport) {
    let reference = match report.reference_spacing {
        0.0 => "on the table's own lattice".to_owned(),
        h => format!("on a lattice of {:.4} mm", 1e3 * h),
    };
    crate::say!(
        "  error          against direct evaluation {reference} at {} held-out poses (seed {}), of \
         each rms:",
        report.poses,
        report.seed
    );
    for (name, e) in report.quantities() {
        let percent = |value: f64| 100.0 * value / e.scale;
        let [x, y, z, qx, qy, qz, qw] = e.worst_pose;
        crate::say!(
            "    {name:<7} rms {:.3} %, p99 {:.3} %, worst {:.2} % at t = ({x:.6}, {y:.6}, {z:.6}) \
             m, q = ({qx:.5}, {qy:.5}, {qz:.5}, {qw:.5})",
            percent(e.rms),
            percent(e.p99),
            percent(e.worst)
        );
    }
    if let Some(condition) = report.condition {
        crate::say!("    the terms of a score are {condition:.3} times the score in all (median)");
    }
}
