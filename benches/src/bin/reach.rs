//! Small parts beside large ones: `reach [--out DIR] [--only TEXT] [--folder PAIRS] [PARTS_DIR]`.
//!
//! Time and memory from two meshes to where one belongs, or to the first energy, without a cache: what
//! grows with the larger part's box, and what with the surface in reach. Every scene has a process of
//! its own. With `PARTS_DIR` IndustReal's pegs in their trays, with `--folder` the pairs that
//! `docs/docking.md` describes. Writes `reach.csv`.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, Docking, DockingRequest, EnergySource, PairSetup, Pose,
};
use pegfit_benches::assemblies::modelled;
use pegfit_benches::docking_cases::{Case, folder};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome};
use pegfit_fixtures::{RightPlaces, pin_in_perforated_plate, screw_in_large_plate};
use sdf_grid::{Silent, TriangleMesh};

/// Side of a plate and diameter of its pin, millimetres, and what docking took before fields were
/// computed on demand: wall seconds and GiB.
const PLATES: [([f64; 2], &str); 3] = [
    ([100.0, 8.0], "45 s, 0.8 GiB"),
    ([200.0, 6.0], "200 s, 3.4 GiB"),
    ([400.0, 5.0], "more than 400 s, 12.2 GiB"),
];

/// Share of its bytes from which on a loop's pair is computed whole.
const MOST_OF_IT: f64 = 0.35;

/// What the whole pair of the largest plate took.
const BEFORE: &str = "49 s, 3.8 GiB";

/// What a scene is asked for.
enum Task {
    Dock(RightPlaces),
    Score,
    /// The first force of a loop near the fit.
    Loop,
}

struct Scene {
    name: String,
    parts: [Arc<TriangleMesh>; 2],
    task: Task,
    before: &'static str,
}

struct Wanted {
    only: String,
    folder: Option<PathBuf>,
    parts: Option<PathBuf>,
    /// Runs this scene alone, in this process.
    alone: Option<usize>,
}

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let scenes = scenes(&wanted)?;
    if let Some(index) = wanted.alone {
        let done = run(scenes.get(index).ok_or("no such scene")?)?;
        println!("{done}");
        return Ok(());
    }
    let about = "From two meshes to where the moving part belongs, to the first energy and wrench of \
        every cell (score), or to the first of a loop near the fit, \
        each in a process of its own, without a cache: wall seconds, the peak of the memory, whether \
        the first place is right, and time and memory before fields were computed where they are in \
        reach.";
    let columns = ["scene", "task", "seconds", "GiB", "right", "before"];
    let mut table = Table::new("reach", "Small parts beside large ones", about, &columns);
    for (index, scene) in scenes.iter().enumerate() {
        if !scene.name.contains(&wanted.only) {
            continue;
        }
        let output = Command::new(std::env::current_exe()?)
            .args(std::env::args().skip(1))
            .args(["--alone", &index.to_string()])
            .output()?;
        let said = String::from_utf8_lossy(&output.stdout);
        let last = said.lines().last().unwrap_or("failed - -");
        println!("{}: {last}", scene.name);
        let task = match scene.task {
            Task::Dock(_) => "dock",
            Task::Score => "score",
            Task::Loop => "loop",
        };
        let words: Vec<String> = last.split(' ').map(Into::into).collect();
        let [seconds, memory, right] = words.try_into().unwrap_or_default();
        let cells = [&scene.name, task, &seconds, &memory, &right, scene.before];
        table.push(cells.map(Into::into));
    }
    arguments.publish(&table, None)
}

fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let mut wanted = Wanted {
        only: String::new(),
        folder: None,
        parts: None,
        alone: None,
    };
    let mut words = std::mem::take(&mut arguments.rest).into_iter();
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--only" => wanted.only = value()?,
            "--folder" => wanted.folder = Some(value()?.into()),
            "--alone" => wanted.alone = Some(value()?.parse()?),
            _ if word.starts_with('-') => return Err(format!("unknown option {word}").into()),
            _ => wanted.parts = Some(word.into()),
        }
    }
    Ok(wanted)
}

fn scenes(wanted: &Wanted) -> Outcome<Vec<Scene>> {
    let there = |moving: &TriangleMesh| RightPlaces::new(moving, &[Default::default()]);
    let mut all = Vec::new();
    if let Some(parts) = &wanted.parts {
        for pair in modelled(Some(parts.as_path()))? {
            let before = match pair.name.contains("tray") {
                true => "31 - 54 s",
                false => "",
            };
            let case = Case::assembled("parts", pair);
            let looped = case.name.contains("tray").then(|| Scene {
                task: Task::Loop,
                parts: case.parts.clone(),
                name: case.name.clone(),
                before: "5 - 10 s",
            });
            all.push(Scene {
                task: Task::Dock(case.right),
                parts: case.parts,
                name: case.name,
                before,
            });
            all.extend(looped);
        }
    }
    for ([side, diameter], before) in PLATES {
        let [plate, pin] = pin_in_perforated_plate(side, diameter)?;
        all.push(Scene {
            name: format!("pin of {diameter} mm, plate of {side} mm"),
            task: Task::Dock(there(&pin)),
            parts: [plate, pin].map(Arc::new),
            before,
        });
    }
    // The largest plate once more.
    if let Some(Scene { name, parts, .. }) = all.last() {
        all.push(Scene {
            name: name.clone(),
            parts: parts.clone(),
            task: Task::Loop,
            before: BEFORE,
        });
    }
    all.push(Scene {
        name: "screw of 3 mm, plate of 200 mm".into(),
        parts: screw_in_large_plate()?.map(Arc::new),
        task: Task::Score,
        before: "34 s, 1.4 GiB",
    });
    if let Some(path) = &wanted.folder {
        let pairs = folder(path, "")?.into_iter();
        all.extend(pairs.map(|case| Scene {
            name: case.name,
            parts: case.parts,
            task: Task::Dock(case.right),
            before: "10 - 210 s, up to 10.4 GiB",
        }));
    }
    Ok(all)
}

/// Seconds, GiB, and whether the place is right.
fn run(scene: &Scene) -> Outcome<String> {
    let began = Instant::now();
    let [fixed, moving] = scene.parts.clone();
    let setup = PairSetup::new(fixed, moving);
    let right = match &scene.task {
        Task::Score => {
            let pairs = setup.load_at(&[Pose::IDENTITY], &Silent)?;
            let (pair, _) = pairs.first().ok_or("no pair")?;
            let source = DirectEvaluator::new(pair, &DirectOptions::FULL)?;
            let response = source.evaluate(&Pose::IDENTITY, &mut source.scratch());
            eprintln!("{:e} J", response.energy);
            "-"
        }
        Task::Loop => {
            let few = DirectOptions::REAL_TIME;
            let setup = setup.with_points(few.max_points.ok_or("no limit")?)?;
            let near = setup.displacements(setup.plan_unlimited()?.pivot);
            let pair = setup.load_partly(&near, MOST_OF_IT, &Silent)?;
            let source = DirectEvaluator::new(&pair, &few)?;
            let response = source.evaluate(&Pose::IDENTITY, &mut source.scratch());
            eprintln!("{:e} J, spacing {:e} m", response.energy, pair.spacing());
            "-"
        }
        Task::Dock(right) => {
            let found = Docking::new(&setup, DockingRequest::default()).run(&Silent)?;
            eprintln!(
                "fields {:.1} s, then {:?}",
                found.field_seconds, found.stages
            );
            let first = &found.poses[0];
            let mut all = std::iter::once(&first.found.pose).chain(&first.alike);
            match all.any(|p| right.find((p.rotation, p.translation)).is_some()) {
                true => "yes",
                false => "no",
            }
        }
    };
    let seconds = significant(began.elapsed().as_secs_f64(), 2);
    let memory = peak_memory(Path::new("/proc/self/status"));
    let memory = memory.map_or("-".into(), |gib| significant(gib, 2));
    Ok(format!("{seconds} {memory} {right}"))
}

/// The most memory that a process held, GiB, where the system tells.
fn peak_memory(status: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(status).ok()?;
    let line = text.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / f64::from(1 << 20))
}
