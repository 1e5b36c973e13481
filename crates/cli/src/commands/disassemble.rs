//! `pegfit disassemble`: in which order does an assembly come apart?

use std::path::Path;

use fft_correlate::Placement;
use pegfit_path::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, DisassemblyStep,
    DisassemblyTries,
};
use pegfit_scene::{PlacedParts, Scene};
use sdf_grid::{LengthUnit, TriangleMesh, atomic};
use serde::Serialize;

use crate::args::DisassembleArgs;
use crate::commands::path::time_limit;
use crate::commands::{resume, scenes};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::require_folder;
use crate::report::path::{self, Summary, path_rows, words};
use crate::report::player::{Act, Player, poses};

/// Letters of a part's name that a file's name has at most.
const LONGEST_NAME: usize = 60;

pub(crate) fn run(args: &DisassembleArgs, context: &Context) -> Result<(), CommandError> {
    for output in [&args.output, &args.html, &args.resume]
        .into_iter()
        .flatten()
    {
        require_folder(output)?;
    }
    let time_limit = time_limit(args.seconds)?;
    let mut tried: DisassemblyTries = resume::read(args.resume.as_deref())?;
    let scene = Scene::read(&args.scene)?;
    let placed = PlacedParts::read(&scene)?;
    scenes::print_warnings(&placed.warnings, context);
    let metre = scene.unit.in_metres();
    let options = DisassemblyRequest {
        tolerance: args.tolerance.map(|t| t * metre),
        step: args.step.map(|s| s * metre),
        time_limit,
        allow_overlap: args.allow_overlap,
        largest_group: args.group,
    };
    let named = |(name, mesh): &(String, _)| AssemblyPart {
        name: name.clone(),
        mesh: std::sync::Arc::clone(mesh),
    };
    let names: Vec<&str> = placed.parts.iter().map(|p| p.0.as_str()).collect();
    let search = DisassemblySearch::new(placed.parts.iter().map(named).collect(), options)?;
    let found = search.run_from(&mut tried, &context.progress);
    context.progress.finish();
    let decided = |found: &DisassemblyResult| found.locked.iter().all(|locked| locked.exhausted);
    let found = resume::after(args.resume.as_deref(), found, decided, &tried)?;
    let files: Option<Vec<String>> = args.output.as_ref().map(|_| {
        let numbered = found.steps.iter().enumerate();
        numbered.map(|(i, s)| file_name(i, s, &names)).collect()
    });
    let order = Order::new(&found, &names, files.as_deref());
    if let (Some(folder), Some(files)) = (&args.output, &files) {
        write(folder, files, &found, &order)?;
    }
    if let Some(file) = &args.html {
        let title = args.scene.file_stem().unwrap_or_default().to_string_lossy();
        let meshes: Vec<&TriangleMesh> = placed.parts.iter().map(|p| p.1.as_ref()).collect();
        atomic::write(file, page(&title, &found, &names, &meshes).as_bytes())?;
    }
    context.show(&order, || print(&found, &names, placed.display_unit))
}

/// `03-lid+screw.csv`.
fn file_name(step: usize, of: &DisassemblyStep, names: &[&str]) -> String {
    let parts: Vec<&str> = of.parts.iter().map(|p| names[*p]).collect();
    let plain = |c: char| match c.is_alphanumeric() || "+-_.".contains(c) {
        true => c,
        false => '-',
    };
    let name: String = parts
        .join("+")
        .chars()
        .map(plain)
        .take(LONGEST_NAME)
        .collect();
    format!("{:02}-{name}.csv", step + 1)
}

/// A page that plays the steps.
fn page(
    title: &str,
    found: &DisassemblyResult,
    names: &[&str],
    meshes: &[&TriangleMesh],
) -> String {
    let acts = found.steps.iter().enumerate().map(|(i, step)| Act {
        said: format!("{}. {}", i + 1, describe_step(step, names)),
        moving: step.parts.clone(),
        staying: step.rest.clone(),
        poses: poses(&step.path, &Placement::default()),
    });
    let player = Player {
        towards: "out",
        parts: meshes,
        acts: acts.collect(),
        start: 0,
    };
    path::page(&format!("How it comes apart: {title}"), &player, "")
}

/// The path of each step, and the order.
fn write(
    folder: &Path,
    files: &[String],
    found: &DisassemblyResult,
    order: &Order,
) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder).map_err(|e| CommandError::write(folder, e))?;
    for (file, step) in files.iter().zip(&found.steps) {
        let file = folder.join(file);
        atomic::write_with(&file, |out| {
            path_rows(&step.path, &Placement::default(), out)
                .map_err(|e| CommandError::failure(file.display().to_string(), e))
        })?;
    }
    let text = serde_json::to_string_pretty(order)
        .map_err(|e| CommandError::failure("writing JSON", e))?;
    Ok(atomic::write(&folder.join("order.json"), text.as_bytes())?)
}

/// An order for programs: metres, radians, in the scene.
#[derive(Serialize)]
pub(super) struct Order {
    /// Names of the parts, the base first.
    parts: Vec<String>,
    /// Whether all parts come apart.
    apart: bool,
    steps: Vec<Step>,
    locked: Vec<Locked>,
    tries: usize,
    poses_looked_at: usize,
    seconds: f64,
}

/// Parts that come off, outwards from where they are assembled.
#[derive(Serialize)]
struct Step {
    parts: Vec<String>,
    rest: Vec<String>,
    file: Option<String>,
    #[serde(flatten)]
    path: Summary,
}

/// Parts that block each other.
#[derive(Serialize)]
struct Locked {
    parts: Vec<String>,
    /// Whether everything was tried.
    exhausted: bool,
}

fn named(parts: &[usize], names: &[&str]) -> Vec<String> {
    parts.iter().map(|p| names[*p].to_owned()).collect()
}

impl Order {
    /// `files` are those of the steps, if they are written.
    pub(super) fn new(found: &DisassemblyResult, names: &[&str], files: Option<&[String]>) -> Self {
        let step = |(i, s): (usize, &DisassemblyStep)| Step {
            parts: named(&s.parts, names),
            rest: named(&s.rest, names),
            file: files.and_then(|f| f.get(i).cloned()),
            path: Summary::new(&s.path, &Placement::default(), None),
        };
        let locked = found.locked.iter().map(|l| Locked {
            parts: named(&l.parts, names),
            exhausted: l.exhausted,
        });
        Self {
            parts: names.iter().map(|n| (*n).to_owned()).collect(),
            apart: found.locked.is_empty(),
            steps: found.steps.iter().enumerate().map(step).collect(),
            locked: locked.collect(),
            tries: found.tries,
            poses_looked_at: found.poses_checked,
            seconds: found.seconds,
        }
    }
}

/// What comes off what, by which motions.
pub(super) fn describe_step(step: &DisassemblyStep, names: &[&str]) -> String {
    format!(
        "{} off {}: {}",
        named(&step.parts, names).join(" + "),
        named(&step.rest, names).join(", "),
        words(&step.path.motions, &Placement::default()),
    )
}

/// Prints the order.
fn print(found: &DisassemblyResult, names: &[&str], unit: LengthUnit) {
    let metre = unit.in_metres();
    let head = match (found.steps.is_empty(), found.locked.is_empty()) {
        (_, true) => "comes apart",
        (false, false) => "comes apart in part",
        (true, false) => "does not come apart",
    };
    say!(
        "{head}: {} parts, {} steps, {} parts and groups tried, {} poses looked at, {:.1} s",
        names.len(),
        found.steps.len(),
        found.tries,
        found.poses_checked,
        found.seconds
    );
    for (i, step) in found.steps.iter().enumerate() {
        say!(
            "  {}. {} ({:.3} {unit} long, largest overlap {:.5} {unit})",
            i + 1,
            describe_step(step, names),
            step.path.length() / metre,
            step.path.deepest().1 / metre
        );
    }
    for locked in &found.locked {
        let how = match locked.exhausted {
            true => "everything was tried at these steps",
            false => {
                "no proof: time ran out, or larger groups were not tried; allow more \
                      --seconds or a larger --group"
            }
        };
        let parts = named(&locked.parts, names).join(", ");
        say!("  {parts} block each other: {how}");
    }
}
