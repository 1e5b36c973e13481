//! `pegfit demo`: the paper's three examples from meshes to felt forces, and a page about them.

mod page;
mod summary;

use std::path::{Path, PathBuf};
use std::time::Instant;

use fft_correlate::table::Errors;
use fft_correlate::{
    DirectEvaluator, DirectOptions, DockingRequest, EnergyScale, EnergySource, EnergyTable, Pose,
    Share, bake, measure_error,
};
use haptic::{Clock, Sample, Script};
use pegfit_pictures::{Plot, PlotSheet, Slice};
use pegfit_scene::{Assembly, Scene, SceneSetup, example_text};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{atomic, mesh_io};

use crate::args::DemoArgs;
use crate::commands::demo::page::{Figure, Shown};
use crate::commands::demo::summary::{Dock, Example, Picture, Summary, Table};
use crate::commands::plot::{
    Along, CURVE, DENSITIES, OVERLAP, SCORE, analyse, curve, densities, force_chart, overlap,
    score_surface,
};
use crate::commands::{dock, haptic_session, scenes, stored};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::player::{self, Act, Player};
use crate::terminal::progress::check_interrupt;

/// What to do after the demo.
const NEXT: &str = "
With parts of your own, two closed meshes from one assembly, each in its place (scene.toml):
    unit = \"mm\"
    fixed = \"hole.stl\"
    moving = \"peg.stl\"
then
    pegfit check scene.toml                 can the meshes be used, in this unit, in this place?
    pegfit plot well scene.toml             is the fit a fit?
    pegfit play scene.toml                  hold the part with your mouse
From an assembly in one file: pegfit scene assembly.step";

pub(in crate::commands) fn run(args: &DemoArgs, context: &Context) -> Result<(), CommandError> {
    let began = Instant::now();
    std::fs::create_dir_all(&args.out).map_err(|e| CommandError::write(&args.out, e))?;
    let (mut examples, mut shown) = (Vec::new(), Vec::new());
    for shape in PegInHole::ALL {
        check_interrupt()?;
        let (example, pictures) = run_example(shape, &args.out, context)?;
        examples.push(example);
        shown.push(pictures);
    }
    let summary = Summary {
        examples,
        seconds: began.elapsed().as_secs_f64(),
    };
    let page = page::write(&args.out, &summary, &shown)?;
    context.show(&summary, || print(&summary, &page))
}

fn print(summary: &Summary, page: &Path) {
    say!("example       fields    table     dock    tests   table error  transforms  fit found");
    say!("                 (s)      (s)      (s)      (s)     force (%)  score (%)   to (mm, °)");
    for e in &summary.examples {
        say!(
            "{:<12} {:>7.1} {:>8.1} {:>8.1} {:>8.1} {:>12.2} {:>11.1e}  {:.3}, {:.2}",
            e.name,
            e.field_seconds,
            e.table.seconds,
            e.dock.seconds,
            e.test_seconds,
            100.0 * e.table.force_error,
            100.0 * e.quadrature_error,
            1e3 * e.dock.from_fit_m,
            e.dock.from_fit_degrees,
        );
    }
    for e in &summary.examples {
        if let Some(r) = &e.real_time {
            say!(
                "real-time loop ({}, from its table): {:.0} Hz, latency p50 {:.0} µs, p99 {:.0} µs, {} overruns in \
                 {} ticks",
                e.name,
                r.rate_hz,
                r.latency_us.p50,
                r.latency_us.p99,
                r.overruns,
                r.ticks
            );
        }
    }
    say!("{:.0} s in all; open {}", summary.seconds, page.display());
    say!("{NEXT}");
}

/// Seconds of the two tests in simulated time.
const TEST_SECONDS: f64 = 6.0;

/// Seconds of the loop in real time.
const LOOP_SECONDS: f64 = 10.0;

/// Held-out poses on which the table is compared with direct sums.
const POSES: usize = 1000;

fn run_example(
    shape: PegInHole,
    out: &Path,
    context: &Context,
) -> Result<(Example, Shown), CommandError> {
    let name = shape.name();
    context.progress.note(&format!("{name} peg and hole"));
    let assembly = scenes::load(write_scene(shape, out)?, context)?;
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
    let run = |script, clock, seconds| {
        haptic_session::run_simulated(&assembly, &fast, script, seconds, clock)
    };
    let test = |script| run(script, Clock::Simulated, TEST_SECONDS);
    let (collision, snap) = rayon::join(|| test(Script::Collision), || test(Script::Snap));
    let (collision, snap) = (collision?, snap?);
    let test_seconds = began.elapsed().as_secs_f64();
    let real_time = match shape {
        PegInHole::Rectangular => {
            let (snap, clock) = (Script::Snap, Clock::Real);
            let source = energies.in_scene();
            let felt =
                haptic_session::run_simulated(&assembly, &source, snap, LOOP_SECONDS, clock)?;
            Some(felt.report)
        }
        _ => None,
    };
    let sheets = figures(&assembly, [&collision.samples, &snap.samples], context)?;
    let pictures = write_pictures(name, out, &sheets)?;
    let shown = Shown {
        player: player(&assembly, &fast),
        figures: page::figures(sheets)?,
    };
    let example = Example {
        name,
        triangles: [&assembly.setup.parts.fixed, &assembly.setup.parts.moving]
            .map(|m| m.triangles().len()),
        spacing_m: assembly.pair.spacing(),
        field_nodes: assembly.pair.fixed().lattice().len() + assembly.pair.moving().lattice().len(),
        field_seconds: assembly.field_seconds,
        quadrature_error: quadrature(&assembly, &direct)?,
        table,
        dock,
        well: analyse(&assembly)?,
        test_seconds,
        snap_ends_m: assembly.from_fit(&snap.last.object).0,
        collision: collision.report,
        snap: snap.report,
        real_time,
        pictures,
    };
    Ok((example, shown))
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
        .map_err(|e| stored::bake_error(path, e))?;
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
    let docking = dock::find_poses(&setup, options, context)?;
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
        joint: best.joint.kind.name(),
        information: best.hold.information,
        seconds,
        best_energy: best.found.energy,
        from_fit_m: shift,
        from_fit_degrees: turn.to_degrees(),
    })
}

/// Poses of the path in that the page shows, and the shares of the depth from which and to which they go.
const STEPS: u32 = 80;
const SPAN: (f64, f64) = (-0.5, 1.0);

/// Both parts in space; the moving one slides straight in.
fn player(assembly: &Assembly, source: &dyn EnergySource) -> String {
    let geometry = assembly.geometry(source);
    let mut scratch = source.scratch();
    let poses = (0..=STEPS).map(|k| {
        let share = SPAN.0 + (SPAN.1 - SPAN.0) * f64::from(k) / f64::from(STEPS);
        let pose = Pose {
            translation: geometry.seated.translation
                + geometry.axis * (geometry.depth * (share - 1.0)),
            ..geometry.seated
        };
        let felt = source.evaluate(&pose, &mut scratch);
        let sizes = [felt.wrench.force, felt.wrench.torque].map(|v| v.length());
        let force = [felt.energy, sizes[0], sizes[1]];
        player::pose(&pose, share * geometry.depth, 0.0, Some(force))
    });
    let act = Act {
        said: String::new(),
        moving: vec![1],
        staying: vec![0],
        poses: poses.collect(),
    };
    let surfaces = [
        assembly.setup.placed_fixed(),
        assembly.setup.moving_at(&Pose::IDENTITY),
    ];
    Player {
        towards: "in",
        parts: &surfaces.each_ref(),
        acts: vec![act],
        start: STEPS as usize / 3,
    }
    .html()
}

/// Width and height of forces against time, pixels.
const TESTS: (u32, u32) = (1300, 560);

fn figures(
    assembly: &Assembly,
    [collision, snap]: [&[Sample]; 2],
    context: &Context,
) -> Result<Vec<Figure>, CommandError> {
    let slice = Slice { axis: 1, at: 0.0 };
    let across = Slice { axis: 2, at: 0.0 };
    let force = |title: &str, samples| PlotSheet {
        what: "force against time",
        plots: vec![Plot::Lines(force_chart(title.to_owned(), samples))],
        across: 1,
    };
    let setup = &assembly.setup;
    let drawn = [
        ("density", DENSITIES, densities(setup, &slice, context)?),
        ("section", DENSITIES, densities(setup, &across, context)?),
        ("overlap", OVERLAP, overlap(setup, &slice, context)?),
        ("score", SCORE, score_surface(assembly, [0, 2])?),
        ("energy-x", CURVE, curve(assembly, Along::Axis(0))?),
        ("energy-z", CURVE, curve(assembly, Along::Axis(2))?),
        ("energy-rz", CURVE, curve(assembly, Along::About(2))?),
        ("collision", TESTS, force("Collision test", collision)),
        ("snap", TESTS, force("Snap test", snap)),
    ];
    Ok(drawn
        .map(|(kind, size, sheet)| Figure { kind, size, sheet })
        .into())
}

fn write_pictures(
    name: &str,
    out: &Path,
    figures: &[Figure],
) -> Result<Vec<Picture>, CommandError> {
    let write = |figure: &Figure| {
        let path = PathBuf::from(format!("{name}-{}.png", figure.kind));
        atomic::write(&out.join(&path), &figure.sheet.png(figure.size)?)?;
        Ok(Picture {
            kind: figure.kind,
            path,
        })
    };
    figures.par_iter().map(write).collect()
}

/// Displacements compared.
const QUADRATURE_POSES: usize = 400;

/// Relative root mean square difference of both scores at random lattice displacements of the
/// assembled rotation, where both sum the same products.
fn quadrature(assembly: &Assembly, direct: &DirectEvaluator) -> Result<f64, CommandError> {
    let window = assembly.design()?.window;
    let score = assembly.scores(&window)?;
    let rotation = assembly.setup.parts.assembled.rotation;
    let mut rng = SmallRng::seed_from_u64(11);
    let (mut difference, mut reference) = (0.0, 0.0);
    for _ in 0..QUADRATURE_POSES {
        let index = window.shape().map(|n| rng.random_range(0..n));
        let pose = assembly.pair.pose(rotation, window.displacement(index));
        let expected = direct.score(&pose).re;
        difference += (f64::from(score[index]) - expected).powi(2);
        reference += expected.powi(2);
    }
    Ok((difference / reference).sqrt())
}

/// Writes the meshes and the scene, and reads the scene back as a user would.
pub(in crate::commands) fn write_scene(
    shape: PegInHole,
    out: &Path,
) -> Result<Scene, CommandError> {
    let name = shape.name();
    let (hole, peg) = shape.pair(0.0)?;
    for (part, mesh) in [("hole", &hole), ("peg", &peg)] {
        mesh_io::write_obj(out.join(format!("{name}_{part}.obj")), mesh)?;
    }
    let path = out.join(format!("{name}.toml"));
    atomic::write(&path, example_text(shape).as_bytes())?;
    Ok(Scene::read(&path)?)
}
