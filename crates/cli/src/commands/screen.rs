//! `pegfit screen`: which parts of a library fit a part, where, and how well?

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use fft_correlate::dock::CONVINCING;
use fft_correlate::{
    Docking, DockingError, DockingRequest, DockingResult, PairBuilder, PairSetup, Placement,
};
use pegfit_scene::poses::POSE_COLUMNS;
use sdf_grid::{Monitor, RepairOptions, TriangleMesh, mesh_io};
use serde::Serialize;

use super::docked_pose::DockedPose;
use super::part_files::{mesh_files, read_file};
use super::screen_rows::{ScreenProvenance, ScreenRow, ScreenRows};
use super::worker_share::{Batch, WorkerShare};
use crate::args::ScreenArgs;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::require_folder;
use crate::report::table_file::{self, Cell, Column, ColumnKind};
use crate::terminal::progress::{Progress, interrupted};

/// What is shared.
const BATCH: Batch = Batch {
    does: "screens",
    all: "all of the library",
};

/// Rows that are printed.
const SHOWN: usize = 25;

/// A screen for programs.
#[derive(Serialize)]
struct Summary {
    table: String,
    /// Where the rows of single files lie.
    rows_folder: String,
    share: WorkerShare,
    /// Files of the library, those whose rows are there, and those of them that were screened now.
    files: usize,
    finished: usize,
    screened: usize,
    /// Whether the table was written.
    complete: bool,
    /// Parts that contact holds firmly, those that could not be screened, and all that are known.
    held: usize,
    failed: usize,
    rows: Vec<ScreenRow>,
}

pub(super) fn run(args: &ScreenArgs, context: &Context) -> Result<(), CommandError> {
    let share = WorkerShare::of(args.rank, args.size, &BATCH)?;
    table_file::require("--output", &args.output)?;
    require_folder(&args.output)?;
    let files = mesh_files(&args.library, true)?;
    let screen = Screen::new(args, context)?;
    let rows = ScreenRows::beside(&args.output, &args.library, screen.provenance(args));
    let mut screened = 0;
    if !args.status {
        share.note(context);
        let there = files.iter().filter(|f| rows.exist(f)).count();
        if there > 0 && share.size == 1 && !args.resume {
            return Err(CommandError::input(
                rows.folder().display().to_string(),
                "rows",
                "nothing, or --resume to keep those of the same parts and options",
                format!("rows of {there} files"),
            ));
        }
        rows.create()?;
        screened = screen.run(&files, &rows, &share, &context.progress)?;
    }
    let summary = summary(args, (&files, screened), &rows, share)?;
    if summary.complete && !args.status {
        table_file::write(&args.output, &COLUMNS, &cells(&summary.rows))?;
    }
    context.show(&summary, || print(&summary, args))?;
    match interrupted() && !summary.complete {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// Only whether it shall stop is passed on: stages of single parts would hide how far the screen is.
struct Stop<'a>(&'a Progress);

impl Monitor for Stop<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// What every part of the library is docked on, and how.
struct Screen<'a> {
    args: &'a ScreenArgs,
    fixed: Arc<TriangleMesh>,
    others: Vec<Arc<TriangleMesh>>,
    /// Metres.
    mating_clearance: Option<f64>,
    memory: u64,
}

impl<'a> Screen<'a> {
    fn new(args: &'a ScreenArgs, context: &Context) -> Result<Self, CommandError> {
        let (fixed, report) = mesh_io::read_with(&args.fixed, &args.choice.options(args.unit))?;
        let mut warnings = report.warnings();
        let mut others = Vec::new();
        for path in &args.keep_apart {
            let (mesh, report) = mesh_io::read(path, args.unit, &RepairOptions::default())?;
            warnings.extend(report.warnings());
            others.push(Arc::new(mesh));
        }
        for warning in warnings {
            context.progress.note(&format!("note: {warning}"));
        }
        let clearance = args.mating_clearance;
        if clearance.is_some_and(|c| !(c.is_finite() && c > 0.0)) {
            let found = clearance.unwrap_or_default();
            let expected = "a positive length";
            return Err(CommandError::option("--mating-clearance", expected, found));
        }
        Ok(Self {
            args,
            fixed: Arc::new(fixed),
            others,
            mating_clearance: clearance.map(|c| c * args.unit.in_metres()),
            memory: context.memory,
        })
    }

    /// All that rows depend on but the library's files.
    fn provenance(&self, args: &ScreenArgs) -> ScreenProvenance {
        let hash = |mesh: &Arc<TriangleMesh>| blake3::Hash::from(mesh.hash()).to_hex().to_string();
        let reading = &args.choice.reading;
        ScreenProvenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            fixed: [&self.fixed]
                .into_iter()
                .chain(&self.others)
                .map(hash)
                .collect(),
            mating_clearance: self.mating_clearance,
            unit: args.unit.name().to_owned(),
            solids: args.solids,
            segments_per_turn: reading.segments_per_turn,
            lossy: reading.lossy,
        }
    }

    /// Screens this process's share of the files whose rows are not there; how many it screened.
    fn run(
        &self,
        files: &[PathBuf],
        rows: &ScreenRows,
        share: &WorkerShare,
        progress: &Progress,
    ) -> Result<usize, CommandError> {
        let own = files.iter().enumerate().filter(|(i, _)| share.has(*i));
        let own: Vec<&PathBuf> = own.map(|(_, file)| file).collect();
        progress.begin("screening parts", own.len() as u64);
        let mut screened = 0;
        for file in own {
            if rows.read(file)?.is_none() {
                // What was begun when Ctrl-C came counts for nothing.
                let Some(found) = self.screen_file(file, &rows.name(file), progress) else {
                    break;
                };
                rows.write(file, found)?;
                screened += 1;
            }
            progress.advance(1);
        }
        progress.finish();
        Ok(screened)
    }

    /// The rows of a file; none once a stop has been asked for. What is wrong with a file is a row.
    fn screen_file(&self, file: &Path, name: &str, progress: &Progress) -> Option<Vec<ScreenRow>> {
        if interrupted() {
            return None;
        }
        let (args, began) = (self.args, Instant::now());
        let row = |part: &str, pose, error, began: Instant| ScreenRow {
            file: name.to_owned(),
            part: part.to_owned(),
            pose,
            seconds: began.elapsed().as_secs_f64(),
            error,
        };
        let parts = match read_file(file, args.solids, args.unit, &args.choice.reading) {
            Ok((parts, _)) => parts,
            Err(error) => {
                let stem = file.file_stem().unwrap_or_default().to_string_lossy();
                let failed = row(&stem, None, Some(with_causes(&error)), began);
                return (!interrupted()).then(|| vec![failed]);
            }
        };
        let mut found = Vec::new();
        let mut began = began;
        for (part, mesh) in parts {
            let (pose, error) = match self.dock(mesh, progress) {
                _ if interrupted() => return None,
                Ok(docked) => best(&docked),
                // It fits nowhere, which is no failure.
                Err(DockingError::NothingMates) => (None, None),
                Err(error) => (None, Some(with_causes(&error))),
            };
            found.push(row(&part, pose, error, began));
            began = Instant::now();
        }
        Some(found)
    }

    fn dock(
        &self,
        moving: TriangleMesh,
        progress: &Progress,
    ) -> Result<DockingResult, DockingError> {
        let setup = PairSetup {
            builder: PairBuilder {
                memory_limit: Some(self.memory),
                ..PairBuilder::default()
            },
            ..PairSetup::new(Arc::clone(&self.fixed), Arc::new(moving))
        };
        let request = DockingRequest {
            top: 1,
            mating_clearance: self.mating_clearance,
            others: self.others.clone(),
            contact_only: true,
            ..DockingRequest::default()
        };
        Docking::new(&setup, request).run(&Stop(progress))
    }
}

/// The best pose, and why it has no quality if it has none.
fn best(docked: &DockingResult) -> (Option<DockedPose>, Option<String>) {
    let best = docked.poses.first();
    let pose = best.map(|pose| DockedPose::new(pose, &Placement::IDENTITY));
    let why = docked.no_energies.as_ref();
    (pose, why.map(|e| format!("no quality: {}", with_causes(e))))
}

/// An error with its causes, in one line.
fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let said = inner.to_string();
        // A transparent error repeats its source.
        if !text.ends_with(&said) {
            text += &format!(": {said}");
        }
        cause = inner.source();
    }
    text
}

fn summary(
    args: &ScreenArgs,
    (files, screened): (&[PathBuf], usize),
    kept: &ScreenRows,
    share: WorkerShare,
) -> Result<Summary, CommandError> {
    let mut rows = Vec::new();
    let mut finished = 0;
    for file in files {
        if let Some(found) = kept.read(file)? {
            rows.extend(found);
            finished += 1;
        }
    }
    rows.sort_by(|a, b| {
        let value = |row: &ScreenRow| {
            let pose = row.pose.as_ref();
            let quality = pose.map(|p| p.quality.unwrap_or(-1.0));
            let failed = row.error.is_some() && pose.is_none();
            (
                !failed,
                [quality, pose.map(|p| p.hold)].map(|v| v.unwrap_or(f64::NEG_INFINITY)),
            )
        };
        let ((a_known, a_values), (b_known, b_values)) = (value(a), value(b));
        let order = b_known.cmp(&a_known);
        (a_values.iter().zip(&b_values)).fold(order, |order, (a, b)| order.then(b.total_cmp(a)))
    });
    let is_held = |row: &&ScreenRow| row.pose.as_ref().is_some_and(|p| p.hold >= CONVINCING);
    Ok(Summary {
        table: args.output.display().to_string(),
        rows_folder: kept.folder().display().to_string(),
        share,
        files: files.len(),
        finished,
        screened,
        complete: finished == files.len(),
        held: rows.iter().filter(is_held).count(),
        failed: rows
            .iter()
            .filter(|r| r.pose.is_none() && r.error.is_some())
            .count(),
        rows,
    })
}

const fn number(name: &'static str) -> Column {
    (name, ColumnKind::Number)
}

/// The columns of the table; those of a pose are called as in tables of `pegfit dock`.
const COLUMNS: [Column; 31] = [
    ("file", ColumnKind::Text),
    ("part", ColumnKind::Text),
    number("quality"),
    number("hold"),
    number("information"),
    number("mating_area"),
    number("mating_share"),
    number("overlap"),
    number("penetration"),
    number(POSE_COLUMNS[0]),
    number(POSE_COLUMNS[1]),
    number(POSE_COLUMNS[2]),
    number(POSE_COLUMNS[3]),
    number(POSE_COLUMNS[4]),
    number(POSE_COLUMNS[5]),
    number(POSE_COLUMNS[6]),
    ("joint", ColumnKind::Text),
    ("freedoms", ColumnKind::Count),
    number("axis_x"),
    number("axis_y"),
    number("axis_z"),
    number("point_x"),
    number("point_y"),
    number("point_z"),
    number("pitch"),
    number("slide_low"),
    number("slide_high"),
    ("alike", ColumnKind::Count),
    number("escape"),
    number("seconds"),
    ("error", ColumnKind::Text),
];

fn cells(rows: &[ScreenRow]) -> Vec<Vec<Cell>> {
    rows.iter().map(row_cells).collect()
}

fn row_cells(row: &ScreenRow) -> Vec<Cell> {
    let pose = row.pose.as_ref();
    let of = |value: fn(&DockedPose) -> f64| Cell::from(pose.map(value));
    let three = |value: Option<[f64; 3]>| [0, 1, 2].map(|k| Cell::from(value.map(|v| v[k])));
    let mut cells = vec![Cell::Text(row.file.clone()), Cell::Text(row.part.clone())];
    cells.push(pose.and_then(|p| p.quality).into());
    cells.extend([
        of(|p| p.hold),
        of(|p| p.information),
        of(|p| p.mating_area),
        of(|p| p.mating_share),
        of(|p| p.overlap),
        of(|p| p.penetration),
    ]);
    cells.extend(three(pose.map(|p| p.position)));
    cells.extend([0, 1, 2, 3].map(|k| Cell::from(pose.map(|p| p.rotation[k]))));
    let count = |value: Option<usize>| value.map_or(Cell::Empty, |v| Cell::Count(v as u64));
    cells.push(pose.map_or(Cell::Empty, |p| Cell::Text(p.joint.kind.to_string())));
    cells.push(count(pose.map(|p| p.joint.freedoms)));
    cells.extend(three(pose.and_then(|p| p.joint.axis)));
    cells.extend(three(pose.and_then(|p| p.joint.point)));
    cells.push(pose.and_then(|p| p.joint.pitch).into());
    cells.extend([0, 1].map(|k| Cell::from(pose.and_then(|p| p.joint.slide).map(|v| v[k]))));
    cells.push(count(pose.map(|p| p.alike.len())));
    cells.extend([of(|p| p.escape), Cell::Number(row.seconds)]);
    cells.push(row.error.clone().map_or(Cell::Empty, Cell::Text));
    cells
}

fn print(summary: &Summary, args: &ScreenArgs) {
    if !args.status && !summary.rows.is_empty() {
        say!("  quality    hold   overlap   places   joint          part");
    }
    let shown = if args.status { 0 } else { SHOWN };
    for row in summary.rows.iter().take(shown) {
        let label = match row.part == stem(&row.file) {
            true => row.file.clone(),
            false => format!("{}: {}", row.file, row.part),
        };
        match (&row.pose, &row.error) {
            (Some(pose), _) => {
                let quality = pose.quality.map_or("-".to_owned(), |q| format!("{q:.3}"));
                say!(
                    "  {quality:>7}   {:>5.1}   {:>6.2}%   {:>6}   {:<12}   {label}",
                    pose.hold,
                    100.0 * pose.overlap,
                    1 + pose.alike.len(),
                    pose.joint.kind
                );
            }
            (None, Some(error)) => say!("  failed: {label}: {error}"),
            (None, None) => say!("  contact holds it nowhere: {label}"),
        }
    }
    if !args.status && summary.rows.len() > shown {
        say!("  ... {} more", summary.rows.len() - shown);
    }
    say!(
        "{} of {} files screened; {} of {} parts are held firmly ({CONVINCING} nats or more), {} \
         could not be screened",
        summary.finished,
        summary.files,
        summary.held,
        summary.rows.len(),
        summary.failed
    );
    match summary.complete {
        true if args.status => {}
        true => say!("wrote {}", summary.table),
        false if args.status => say!("rows are kept in {}", summary.rows_folder),
        false if args.resume || summary.share.size > 1 => say!(
            "rows of {} files are kept in {}; the same command goes on",
            summary.finished,
            summary.rows_folder
        ),
        false => say!(
            "rows of {} files are kept in {}; the same command with --resume goes on",
            summary.finished,
            summary.rows_folder
        ),
    }
    if let Some(told) = summary.share.description() {
        say!("{told}");
    }
}

fn stem(file: &str) -> &str {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
