//! One of the demo's examples, from meshes to pictures.

use std::path::{Path, PathBuf};
use std::time::Instant;

use fft_correlate::DockingRequest;
use fft_correlate::table::Errors;
use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyScale, EnergyTable, Share, Well, bake, measure_error,
};
use haptic::{Clock, LoopReport, Sample, Script};
use pegfit_pictures::Slice;
use pegfit_scene::{Assembly, SceneSetup};
use sdf_grid::atomic;
use sdf_grid::shapes::PegInHole;
use serde::Serialize;

use super::errors;
use crate::commands::plot::{
    Along, analyse, curve, densities, force_chart, overlap, score_surface,
};
use crate::commands::{dock, examples, hand, scenes, stored};
use crate::context::Context;
use crate::error::CommandError;

/// Seconds of the two tests in simulated time.
const TEST_SECONDS: f64 = 6.0;

/// Seconds of the loop in real time.
const LOOP_SECONDS: f64 = 10.0;

/// Held-out poses on which the table is compared with direct sums.
const POSES: usize = 1000;

/// What the demo did, for `--json` and the closing table.
#[derive(Serialize)]
pub(super) struct Summary {
    pub(super) examples: Vec<Example>,
    pub(super) seconds: f64,
}

/// What one example gave.
#[derive(Serialize)]
pub(super) struct Example {
    pub(super) name: &'static str,
    pub(super) triangles: [usize; 2],
    pub(super) spacing_m: f64,
    pub(super) field_nodes: usize,
    pub(super) field_seconds: f64,
    /// Relative root mean square difference of correlation and quadrature.
    pub(super) quadrature_error: f64,
    pub(super) table: Table,
    pub(super) dock: Dock,
    pub(super) well: Well,
    pub(super) test_seconds: f64,
    pub(super) collision: LoopReport,
    pub(super) snap: LoopReport,
    /// Distance from the fit at the end of the snap test, metres.
    pub(super) snap_ends_m: f64,
    pub(super) real_time: Option<LoopReport>,
    /// Pictures by what they show.
    pub(super) pictures: Vec<Picture>,
}

/// The table of an example.
#[derive(Serialize)]
pub(super) struct Table {
    pub(super) rotations: usize,
    pub(super) displacements: usize,
    pub(super) bytes: u64,
    pub(super) seconds: f64,
    pub(super) energy_error: f64,
    pub(super) force_error: f64,
    pub(super) torque_error: f64,
}

/// Docking of an example.
#[derive(Serialize)]
pub(super) struct Dock {
    pub(super) rotations: usize,
    pub(super) seconds: f64,
    pub(super) best_energy: f64,
    pub(super) from_fit_m: f64,
    pub(super) from_fit_degrees: f64,
}

/// A picture of the demo.
#[derive(Serialize)]
pub(super) struct Picture {
    pub(super) kind: &'static str,
    pub(super) path: PathBuf,
}

pub(super) fn run(
    shape: PegInHole,
    out: &Path,
    context: &Context,
) -> Result<Example, CommandError> {
    let name = shape.name();
    context.progress.note(&format!("{name} peg and hole"));
    let assembly = scenes::load(examples::write_scene(shape, out)?, context)?;
    let direct = assembly.direct(&DirectOptions::FULL)?;
    let fast = assembly.source(&DirectOptions::REAL_TIME)?;
    let (energies, table) = tabulate(
        &assembly,
        &direct,
        &out.join(format!("{name}.zarr")),
        context,
    )?;
    let dock = search(&assembly, context)?;
    let began = Instant::now();
    let run =
        |script, clock, seconds| hand::run_simulated(&assembly, &fast, script, seconds, clock);
    let collision = run(Script::Collision, Clock::Simulated, TEST_SECONDS)?;
    let snap = run(Script::Snap, Clock::Simulated, TEST_SECONDS)?;
    let test_seconds = began.elapsed().as_secs_f64();
    let real_time = match shape {
        PegInHole::Rectangular => {
            let (snap, clock) = (Script::Snap, Clock::Real);
            let source = energies.in_scene();
            let felt = hand::run_simulated(&assembly, &source, snap, LOOP_SECONDS, clock)?;
            Some(felt.report)
        }
        _ => None,
    };
    let pictures = draw(&assembly, out, [&collision.samples, &snap.samples], context)?;
    Ok(Example {
        name,
        triangles: [&assembly.setup.parts.fixed, &assembly.setup.parts.moving]
            .map(|m| m.triangles().len()),
        spacing_m: assembly.pair.spacing(),
        field_nodes: assembly.pair.fixed().lattice().len() + assembly.pair.moving().lattice().len(),
        field_seconds: assembly.field_seconds,
        quadrature_error: errors::quadrature(&assembly, &direct)?,
        table,
        dock,
        well: analyse(&assembly)?,
        test_seconds,
        snap_ends_m: assembly.from_fit(&snap.last.object).0,
        collision: collision.report,
        snap: snap.report,
        real_time,
        pictures,
    })
}

fn tabulate(
    assembly: &Assembly,
    direct: &DirectEvaluator,
    path: &Path,
    context: &Context,
) -> Result<(EnergyTable, Table), CommandError> {
    let began = Instant::now();
    let design = assembly.design()?;
    let spec = &design.spec;
    let energies = assembly.setup.energies(&design)?;
    discard(path)?;
    bake(path, spec, &energies, Share::ALL, &context.progress)
        .map_err(|e| stored::explain(path, e))?;
    context.progress.finish();
    let table = stored::load(&stored::open(path)?, context)?;
    let seconds = began.elapsed().as_secs_f64();
    let error = measure_error(&table, direct, POSES, 1);
    let share_of = |e: &Errors| e.rms / e.scale;
    let rotations = table.grid().nodes().len();
    let described = Table {
        rotations,
        displacements: spec.window.len(),
        bytes: spec.bytes(rotations) as u64,
        seconds,
        energy_error: share_of(&error.energy),
        force_error: share_of(&error.force),
        torque_error: share_of(&error.torque),
    };
    Ok((table, described))
}

/// Removes the table of an earlier demo, which may be of another version; nothing else.
fn discard(path: &Path) -> Result<(), CommandError> {
    match path.join("zarr.json").exists() {
        true => std::fs::remove_dir_all(path).map_err(|e| CommandError::write(path, e)),
        false => Ok(()),
    }
}

fn search(assembly: &Assembly, context: &Context) -> Result<Dock, CommandError> {
    let began = Instant::now();
    let mut setup: SceneSetup = assembly.setup.clone();
    // The scale of the whole example.
    setup.parts.energy = EnergyScale::Gamma(assembly.pair.model().gamma);
    let options = DockingRequest {
        top: 5,
        ..setup.docking_options()
    };
    let docking = dock::look(&setup, options, context)?;
    let seconds = began.elapsed().as_secs_f64();
    let Some(best) = docking.poses.first() else {
        return Err(CommandError::input(
            assembly.scene().path.display().to_string(),
            "docking",
            "at least one pose",
            "none",
        ));
    };
    let found = assembly.placement().to_scene(&best.found.pose);
    let (shift, turn) = assembly.from_fit(&found);
    Ok(Dock {
        rotations: docking.rotations,
        seconds,
        best_energy: best.found.energy,
        from_fit_m: shift,
        from_fit_degrees: turn.to_degrees(),
    })
}

fn draw(
    assembly: &Assembly,
    out: &Path,
    [collision, snap]: [&[Sample]; 2],
    context: &Context,
) -> Result<Vec<Picture>, CommandError> {
    let slice = Slice { axis: 1, at: 0.0 };
    let across = Slice { axis: 2, at: 0.0 };
    let force = |title: &str, samples| {
        let chart = force_chart(title.to_owned(), samples);
        pegfit_pictures::png("force against time", (1300, 560), |sheet| chart.draw(sheet))
    };
    let drawn = [
        ("density", densities(assembly, &slice, context)?),
        ("section", densities(assembly, &across, context)?),
        ("overlap", overlap(assembly, &slice, context)?),
        ("score", score_surface(assembly, [0, 2])?),
        ("energy-x", curve(assembly, Along::Axis(0))?),
        ("energy-z", curve(assembly, Along::Axis(2))?),
        ("energy-rz", curve(assembly, Along::About(2))?),
        ("collision", force("Collision test", collision)?),
        ("snap", force("Snap test", snap)?),
    ];
    let name = assembly
        .scene()
        .path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    drawn
        .into_iter()
        .map(|(kind, bytes)| {
            let path = PathBuf::from(format!("{name}-{kind}.png"));
            atomic::write(&out.join(&path), &bytes)?;
            Ok(Picture { kind, path })
        })
        .collect()
}
