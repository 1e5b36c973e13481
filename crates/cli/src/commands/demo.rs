//! `pegfit demo`: the paper's three examples from meshes to felt forces, and a page about them.

use std::path::{Path, PathBuf};
use std::time::Instant;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use fft_correlate::table::Errors;
use fft_correlate::{
    DirectEvaluator, DirectOptions, DockingRequest, EnergyScale, EnergyTable, Share, Well, bake,
    measure_error,
};
use haptic::{Clock, LoopReport, Sample, Script};
use pegfit_pictures::Slice;
use pegfit_scene::{Assembly, Scene, SceneSetup, example_text};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{atomic, mesh_io};
use serde::Serialize;

use crate::args::DemoArgs;
use crate::commands::plot::{
    Along, analyse, curve, densities, force_chart, overlap, score_surface,
};
use crate::commands::{dock, haptic_session, scenes, stored};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::page::Page;
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
    let mut examples = Vec::new();
    for shape in PegInHole::ALL {
        check_interrupt()?;
        examples.push(run_example(shape, &args.out, context)?);
    }
    let summary = Summary {
        examples,
        seconds: began.elapsed().as_secs_f64(),
    };
    let page = write_page(&args.out, &summary)?;
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

/// What the demo did, for `--json` and the closing table.
#[derive(Serialize)]
struct Summary {
    examples: Vec<Example>,
    seconds: f64,
}

/// What one example gave.
#[derive(Serialize)]
struct Example {
    name: &'static str,
    triangles: [usize; 2],
    spacing_m: f64,
    field_nodes: usize,
    field_seconds: f64,
    /// Relative root mean square difference of correlation and quadrature.
    quadrature_error: f64,
    table: Table,
    dock: Dock,
    well: Well,
    test_seconds: f64,
    collision: LoopReport,
    snap: LoopReport,
    /// Distance from the fit at the end of the snap test, metres.
    snap_ends_m: f64,
    real_time: Option<LoopReport>,
    /// Pictures by what they show.
    pictures: Vec<Picture>,
}

/// The table of an example.
#[derive(Serialize)]
struct Table {
    rotations: usize,
    displacements: usize,
    bytes: u64,
    seconds: f64,
    energy_error: f64,
    force_error: f64,
    torque_error: f64,
}

/// Docking of an example.
#[derive(Serialize)]
struct Dock {
    /// The joint that contact leaves.
    joint: &'static str,
    /// Of contact, nats.
    information: f64,
    seconds: f64,
    best_energy: f64,
    from_fit_m: f64,
    from_fit_degrees: f64,
}

/// A picture of the demo.
#[derive(Serialize)]
struct Picture {
    kind: &'static str,
    path: PathBuf,
}

fn run_example(shape: PegInHole, out: &Path, context: &Context) -> Result<Example, CommandError> {
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
    let collision = run(Script::Collision, Clock::Simulated, TEST_SECONDS)?;
    let snap = run(Script::Snap, Clock::Simulated, TEST_SECONDS)?;
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
    let pictures = draw(&assembly, out, [&collision.samples, &snap.samples], context)?;
    Ok(Example {
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
        ("density", densities(&assembly.setup, &slice, context)?),
        ("section", densities(&assembly.setup, &across, context)?),
        ("overlap", overlap(&assembly.setup, &slice, context)?),
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
pub(super) fn write_scene(shape: PegInHole, out: &Path) -> Result<Scene, CommandError> {
    let name = shape.name();
    let (hole, peg) = shape.pair(0.0)?;
    for (part, mesh) in [("hole", &hole), ("peg", &peg)] {
        mesh_io::write_obj(out.join(format!("{name}_{part}.obj")), mesh)?;
    }
    let path = out.join(format!("{name}.toml"));
    atomic::write(&path, example_text(shape).as_bytes())?;
    Ok(Scene::read(&path)?)
}

const LEAD: &str = "\
<p>Each of the three pegs below fills its hole exactly: there is no clearance at all. A simulator \
that looks for contacts has nothing to hold on to there. pegfit looks for none. It turns each part \
into a <em>density</em>: a complex number at every point of space that says how near the part's \
surface is, on which side of it the point lies, and how well the part could hold something there. \
Two parts that fit have densities that match, one's inside against the other's outside.</p>\
<p>The <em>score</em> of a pose is the sum of the product of both densities over all space, and \
the <em>energy</em> is minus the score times a scale. Its slope is a force and a torque: away from \
overlap, into the fit. One transform gives the score of every translation at once; a table of many \
rotations, or a direct sum, gives forces a thousand times a second.</p>";

/// Pictures in the order of the page: kind, heading, explanation.
const FIGURES: [(&str, &str, &str); 9] = [
    (
        "density",
        "Densities along the axis",
        "Real and imaginary part of the hole's and the peg's density on the plane through the \
         axis. Just outside a face the density is negative imaginary, just inside it positive \
         imaginary: multiplied, outside and inside give a positive real number. Away from the \
         faces it gathers on the skeleton, the points equally far from several faces. Thin lines \
         are equal distances from the surface, the bold line is the surface.",
    ),
    (
        "section",
        "Densities across the axis",
        "The same across the axis: the shape of the section decides which turns of the peg fit.",
    ),
    (
        "overlap",
        "What the score adds up",
        "The product of both densities with the peg in its hole. Red is reward, where the inside \
         of one part meets the matching outside of the other; blue is penalty.",
    ),
    (
        "score",
        "Score over two translations",
        "The peg is moved sideways (x) and along its axis (z) without turning. The peak is the \
         assembled pose; the ridge is the path out of the hole; beside it the parts overlap and \
         the score falls.",
    ),
    (
        "energy-x",
        "Sideways",
        "Energy and force as the peg is pushed sideways. At zero clearance the energy is a V, \
         rounded over about two lattice steps: any push is answered by a push back.",
    ),
    (
        "energy-z",
        "Along the axis",
        "Energy and force along the axis: the peg is drawn in from either side.",
    ),
    (
        "energy-rz",
        "Turned about the axis",
        "A round peg does not mind being turned, a square one fits four times in a full turn, the \
         keyed one once. Ripples, and the small dip of the round peg every quarter turn, are the \
         lattice's: they shrink with its spacing.",
    ),
    (
        "collision",
        "Collision test",
        "A simulated hand holds the peg in the hole and pushes it about every two seconds in a \
         random direction. The force on the hand is the answer of the walls.",
    ),
    (
        "snap",
        "Snap test",
        "The simulated hand brings the peg near the hole about every second and lets go: the peg \
         is pulled in.",
    ),
];

/// Writes `index.html` and returns its path.
fn write_page(out: &Path, summary: &Summary) -> Result<PathBuf, CommandError> {
    let mut page = Page::new("Three pegs find their holes");
    page.push(LEAD);
    page.heading("What was computed");
    add_numbers(&mut page, summary);
    for example in &summary.examples {
        page.push(&format!("<h2 id=\"{0}\">The {0} peg</h2>", example.name));
        add_story(&mut page, example);
        for (kind, heading, words) in FIGURES {
            let Some(picture) = example.pictures.iter().find(|p| p.kind == kind) else {
                continue;
            };
            let path = out.join(&picture.path);
            let bytes = std::fs::read(&path).map_err(|e| CommandError::read(&path, e))?;
            page.push(&format!(
                "<figure class=\"{kind}\"><figcaption><b>{heading}.</b> {words}</figcaption>\
                 <img alt=\"{heading}\" src=\"data:image/png;base64,{}\"></figure>",
                STANDARD.encode(bytes)
            ));
        }
    }
    let path = out.join("index.html");
    atomic::write(&path, page.finish("").as_bytes())?;
    Ok(path)
}

/// A row of the table: its name, and its value for an example.
type Row = (&'static str, fn(&Example) -> String);

const ROWS: [Row; 11] = [
    ("triangles, hole and peg", |e| {
        format!("{} and {}", e.triangles[0], e.triangles[1])
    }),
    ("lattice spacing", |e| {
        format!("{:.2} mm", 1e3 * e.spacing_m)
    }),
    ("density fields", |e| {
        format!("{} nodes in {:.1} s", e.field_nodes, e.field_seconds)
    }),
    ("table", |e| {
        let t = &e.table;
        format!(
            "{} rotations × {} translations in {:.1} s",
            t.rotations, t.displacements, t.seconds
        )
    }),
    ("table against direct sums: energy, force, torque", |e| {
        let t = &e.table;
        let percent = [t.energy_error, t.force_error, t.torque_error].map(|x| 100.0 * x);
        format!(
            "{:.2} %, {:.2} %, {:.2} %",
            percent[0], percent[1], percent[2]
        )
    }),
    ("transforms against direct sums: score", |e| {
        format!("{:.0e} %", 100.0 * e.quadrature_error)
    }),
    ("docking", |e| {
        format!(
            "held as a {} joint does, {:.0} nats, in {:.1} s",
            e.dock.joint, e.dock.information, e.dock.seconds
        )
    }),
    ("best pose found, from the fit", |e| {
        let dock = &e.dock;
        format!(
            "{:.3} mm and {:.2}°",
            1e3 * dock.from_fit_m,
            dock.from_fit_degrees
        )
    }),
    ("depth of the well", |e| {
        format!("{:.2} mJ", 1e3 * e.well.depth)
    }),
    ("greatest force: collision, snap", |e| {
        format!(
            "{:.2} N, {:.2} N",
            e.collision.peak_force, e.snap.peak_force
        )
    }),
    ("the snap test ends, from the fit", |e| {
        format!("{:.2} mm", 1e3 * e.snap_ends_m)
    }),
];

fn add_numbers(page: &mut Page, summary: &Summary) {
    let examples = &summary.examples;
    let links = examples
        .iter()
        .map(|e| format!("<a href=\"#{0}\">{0}</a>", e.name));
    let head: Vec<String> = std::iter::once(String::new()).chain(links).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let rows = ROWS.iter().map(|(name, value)| {
        let values = examples.iter().map(value);
        std::iter::once((*name).to_owned()).chain(values).collect()
    });
    page.table(true, &head, rows);
    page.paragraph(&format!("{:.0} seconds in all.", summary.seconds));
}

fn add_story(page: &mut Page, example: &Example) {
    page.paragraph(&format!(
        "Files: <code>{0}_hole.obj</code>, <code>{0}_peg.obj</code>, the scene \
         <code>{0}.toml</code> and the table <code>{0}.zarr</code>. Try \
         <code>pegfit feel {0}.toml</code> in this folder.",
        example.name
    ));
    if let Some(r) = &example.real_time {
        page.paragraph(&format!(
            "The loop ran in real time, from the table, for {:.1} s: {:.0} ticks a second, computing \
             time per tick {:.0} µs in the middle and {:.0} µs at 99 %, start of a tick at most {:.0} \
             µs late in 99 %, {} overruns.",
            r.seconds, r.rate_hz, r.latency_us.p50, r.latency_us.p99, r.lateness_us.p99, r.overruns
        ));
    }
}
