//! Existing tables: opened, read, examined, their errors printed.

use std::path::Path;

use fft_correlate::table::ChunkState;
use fft_correlate::{BakeError, EnergyTable, ErrorReport, StoreError, TableStore};
use rayon::prelude::*;
use serde::Serialize;

use crate::context::Context;
use crate::error::{CommandError, Exit};

/// Seed of the held-out poses on which a finished table is compared with the direct evaluator.
pub(super) const SEED: u64 = 1;

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
    TableStore::open(path).map_err(CommandError::table)
}

/// Reads all of a table into memory.
pub(super) fn load(store: &TableStore, context: &Context) -> Result<EnergyTable, CommandError> {
    store.load(context.memory).map_err(CommandError::table)
}

/// What a failed bake is to be called.
pub(super) fn bake_error(path: &Path, error: BakeError) -> CommandError {
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

/// Reads and checks every chunk.
pub(super) fn examine(store: &TableStore, context: &Context) -> Result<Progress, CommandError> {
    store
        .expect_fits(context.memory)
        .map_err(CommandError::table)?;
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

/// Refuses a table of which a rotation, or a part's surface, is damaged.
pub(super) fn expect_whole(store: &TableStore, progress: &Progress) -> Result<(), CommandError> {
    let path = store.path().display();
    let verdict = |reason| Err(CommandError::Verdict(reason, Exit::DamagedTable));
    if let Err(e) = store.expect_surfaces() {
        return verdict(e.to_string());
    }
    match progress.damaged {
        0 => Ok(()),
        count => verdict(format!(
            "{path}: {count} of {} rotations are damaged: bake with --resume",
            progress.rotations
        )),
    }
}

/// The errors that a table states, as shares of each quantity's rms.
pub(super) fn print_error(report: &ErrorReport) {
    let reference = match report.reference_spacing {
        0.0 => "on the table's own lattice".to_owned(),
        h => format!("on a lattice of {:.4} mm", 1e3 * h),
    };
    say!(
        "  error          against direct evaluation {reference} at {} held-out poses (seed {}), of \
         each rms:",
        report.poses,
        report.seed
    );
    for (name, e) in report.quantities() {
        let percent = |value: f64| 100.0 * value / e.scale;
        let [x, y, z, qx, qy, qz, qw] = e.worst_pose;
        say!(
            "    {name:<7} rms {:.3} %, p99 {:.3} %, worst {:.2} % at t = ({x:.6}, {y:.6}, {z:.6}) \
             m, q = ({qx:.5}, {qy:.5}, {qz:.5}, {qw:.5})",
            percent(e.rms),
            percent(e.p99),
            percent(e.worst)
        );
    }
    if let Some(condition) = report.condition {
        say!("    the terms of a score are {condition:.3} times the score in all (median)");
    }
}
