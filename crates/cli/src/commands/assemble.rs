//! `pegfit assemble`: puts loose parts together.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use fft_correlate::{Placement, Pose};
use pegfit_assemble::{
    Assembly, AssemblyError, AssemblyRequest, AssemblyResult, AssemblySearch, LoosePart, Mate,
};
use pegfit_path::PathResult;
use pegfit_scene::poses::pose_fields;
use pegfit_scene::{SolidOptions, SolidSet, unique_name};
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
use sdf_grid::{LengthUnit, TriangleMesh, atomic};
use serde::Serialize;

use crate::args::AssembleArgs;
use crate::commands::path::time_limit;
use crate::commands::scenes::parse_pose;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::require_folder;
use crate::report::path::{self, words};
use crate::report::player::{Act, Player, poses};
use crate::terminal::progress::interrupted;

/// Endings of the files that are read of a folder.
const MESHES: [&str; 8] = ["obj", "stl", "ply", "glb", "gltf", "3mf", "step", "stp"];

/// Parts by name, and the unit that their file states.
type Named = (Vec<(String, TriangleMesh)>, Option<LengthUnit>);

pub(super) fn run(args: &AssembleArgs, context: &Context) -> Result<(), CommandError> {
    let report_file = (args.report.clone()).unwrap_or_else(|| args.output.with_extension("json"));
    for file in [Some(&args.output), Some(&report_file), args.html.as_ref()] {
        file.map_or(Ok(()), |f| require_folder(f))?;
    }
    let (parts, unit) = read_parts(args)?;
    let names: Vec<String> = parts.iter().map(|p| p.name.clone()).collect();
    let request = request(args, &names)?;
    let search = AssemblySearch::new(parts.clone(), request)?;
    let found = search.run(&context.progress);
    context.progress.finish();
    let found = found?;
    let Some(best) = found.assemblies.first() else {
        return Err(AssemblyError::NothingFits.into());
    };
    write_scene(&args.output, best, &parts, unit)?;
    let report = Report::new(&found, &names);
    let text = serde_json::to_vec_pretty(&report)
        .map_err(|e| CommandError::failure(report_file.display().to_string(), e))?;
    atomic::write(&report_file, &text)?;
    if let Some(file) = &args.html {
        let title = args.output.file_stem().unwrap_or_default();
        let page = page(&title.to_string_lossy(), best, &parts);
        atomic::write(file, page.as_bytes())?;
    }
    context.show(&report, || print(&found, &names, &args.output))?;
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// The parts of all files that are wanted, each in its own frame, and the unit of the first file.
fn read_parts(args: &AssembleArgs) -> Result<(Vec<LoosePart>, LengthUnit), CommandError> {
    let files = files(&args.parts)?;
    let each_solid = args.solids || files.len() == 1;
    let mut parts: Vec<LoosePart> = Vec::new();
    let mut names = BTreeSet::new();
    let mut unit = None;
    for file in files {
        let (solids, stated) = match each_solid {
            true => read_solids(&file, args)?,
            false => read_whole(&file, args)?,
        };
        unit = unit.or(stated);
        for (name, mesh) in solids {
            parts.push(LoosePart {
                name: unique_name(&mut names, &name),
                mesh: Arc::new(mesh),
            });
        }
    }
    let known = names.iter().cloned().collect::<Vec<_>>().join(", ");
    for wanted in &args.only {
        if !names.contains(wanted) {
            let expected = format!("one of {known}");
            return Err(CommandError::option("--only", expected, wanted));
        }
    }
    if !args.only.is_empty() {
        parts.retain(|p| args.only.contains(&p.name));
    }
    Ok((parts, unit.unwrap_or(args.unit)))
}

/// A file as one part.
fn read_whole(file: &Path, args: &AssembleArgs) -> Result<Named, CommandError> {
    let reading = &args.reading;
    let limit = Duration::from_secs(reading.step_time_limit);
    let options = ReadOptions::choosing(args.unit, None, reading.segments_per_turn)
        .within(limit, reading.lossy);
    let opened = MeshFile::open(file, &options.step)?;
    let (mesh, report) = opened.clean(&options)?;
    for warning in report.warnings() {
        remark!("{warning}");
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    Ok((vec![(stem.into_owned(), mesh)], opened.stated_unit()))
}

/// The solids of a file.
fn read_solids(file: &Path, args: &AssembleArgs) -> Result<Named, CommandError> {
    let options = SolidOptions {
        unit: args.unit,
        segments_per_turn: args.reading.segments_per_turn,
        step_time_limit: Duration::from_secs(args.reading.step_time_limit),
        lossy: args.reading.lossy,
        ..SolidOptions::default()
    };
    let set = SolidSet::read(file, &options)?;
    let solids = set.solids.iter().enumerate();
    let named = solids.map(|(i, solid)| (set.called(i), solid.mesh.clone()));
    Ok((named.collect(), Some(set.unit())))
}

/// The files that are named, and those of the folders that are named, in the order of their names.
fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, CommandError> {
    let mut found = Vec::new();
    for path in named {
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(|e| CommandError::read(path, e))?;
        let mut inside = Vec::new();
        for entry in entries {
            let file = entry.map_err(|e| CommandError::read(path, e))?.path();
            let ending = file.extension().unwrap_or_default().to_string_lossy();
            if MESHES.contains(&ending.to_lowercase().as_str()) {
                inside.push(file);
            }
        }
        if inside.is_empty() {
            let expected = format!("files that end with {}", MESHES.join(", "));
            let name = path.display().to_string();
            return Err(CommandError::input(name, "folder", expected, "none"));
        }
        inside.sort();
        found.extend(inside);
    }
    Ok(found)
}

fn request(args: &AssembleArgs, names: &[String]) -> Result<AssemblyRequest, CommandError> {
    let number = |option: &str, wanted: &str| {
        let expected = format!("one of {}", names.join(", "));
        let found = names.iter().position(|name| name == wanted);
        found.ok_or_else(|| CommandError::option(option, expected, wanted))
    };
    let mut placed = Vec::new();
    for text in &args.place {
        let Some((part, pose)) = text.split_once('=') else {
            let expected = "PART=x,y,z,qx,qy,qz,qw";
            return Err(CommandError::option("--place", expected, text));
        };
        placed.push((
            number("--place", part)?,
            parse_pose("--place", "a pose", pose)?,
        ));
    }
    let fixed = args.fix.as_ref().map(|part| number("--fix", part));
    Ok(AssemblyRequest {
        fixed: fixed.transpose()?,
        placed,
        mating_clearance: (args.mating_clearance).map(|c| c * args.unit.in_metres()),
        beam: args.beam,
        top: args.top,
        path_time: match args.seconds {
            0.0 => Duration::ZERO,
            seconds => time_limit(seconds)?,
        },
    })
}

/// A scene of the assembly in which the part that comes last moves.
fn write_scene(
    file: &Path,
    assembly: &Assembly,
    parts: &[LoosePart],
    unit: LengthUnit,
) -> Result<(), CommandError> {
    let placed = assembly.placed.iter().map(|p| {
        let part = &parts[p.part];
        (part.name.clone(), TriangleMesh::clone(&part.mesh), p.pose)
    });
    let set = SolidSet::assembled("loose parts", placed, unit);
    set.all_but(set.solids.len() - 1)?.write(file)?;
    Ok(())
}

/// An assembly search for programs: metres, nats, poses `x, y, z, qx, qy, qz, qw`.
#[derive(Serialize)]
struct Report {
    /// All parts that were given.
    parts: Vec<String>,
    /// Parts of equal shape, where there are several.
    equal: Vec<Vec<String>>,
    /// Whether no other assembly is nearly as good.
    certain: bool,
    /// The best first.
    assemblies: Vec<AssemblyReport>,
    pairs: Vec<PairReport>,
    pair_seconds: f64,
    beam_seconds: f64,
    seconds: f64,
}

#[derive(Serialize)]
struct AssemblyReport {
    score: f64,
    /// In the order in which they go together.
    placed: Vec<PlacedReport>,
    left_over: Vec<String>,
    mates: Vec<MateReport>,
    /// Whether it comes apart; none if that was not tried.
    comes_apart: Option<bool>,
    /// Parts that block each other.
    locked: Vec<Vec<String>>,
    /// What goes in, step by step, in words.
    steps: Vec<String>,
}

#[derive(Serialize)]
struct PlacedReport {
    part: String,
    pose: [f64; 7],
}

#[derive(Serialize)]
struct MateReport {
    parts: [String; 2],
    joint: &'static str,
    freedoms: usize,
    information: f64,
    mating_area: f64,
    overlap: f64,
}

#[derive(Serialize)]
struct PairReport {
    parts: [String; 2],
    places: usize,
    rank: Option<f64>,
    seconds: f64,
}

impl Report {
    fn new(found: &AssemblyResult, names: &[String]) -> Self {
        let called =
            |parts: &[usize]| -> Vec<String> { parts.iter().map(|p| names[*p].clone()).collect() };
        let equal = found.shapes.iter().filter(|s| s.len() > 1);
        let pairs = found.pairs.iter().map(|p| PairReport {
            parts: p.parts.map(|part| names[part].clone()),
            places: p.places,
            rank: p.rank,
            seconds: p.seconds,
        });
        Self {
            parts: names.to_vec(),
            equal: equal.map(|s| called(s)).collect(),
            certain: found.is_certain(),
            assemblies: (found.assemblies.iter())
                .map(|a| AssemblyReport::new(a, names))
                .collect(),
            pairs: pairs.collect(),
            pair_seconds: found.pair_seconds,
            beam_seconds: found.beam_seconds,
            seconds: found.seconds,
        }
    }
}

impl AssemblyReport {
    fn new(assembly: &Assembly, names: &[String]) -> Self {
        let called =
            |parts: &[usize]| -> Vec<String> { parts.iter().map(|p| names[*p].clone()).collect() };
        let apart = assembly.disassembly.as_ref();
        let mate = |m: &Mate| MateReport {
            parts: m.parts.map(|part| names[part].clone()),
            joint: m.joint.kind.name(),
            freedoms: m.joint.kind.freedoms(),
            information: m.information,
            mating_area: m.area,
            overlap: m.overlap,
        };
        Self {
            score: assembly.score,
            placed: (assembly.placed.iter())
                .map(|p| PlacedReport {
                    part: names[p.part].clone(),
                    pose: pose_fields(&p.pose),
                })
                .collect(),
            left_over: called(&assembly.left_over),
            mates: assembly.mates.iter().map(mate).collect(),
            comes_apart: apart.map(|d| d.locked.is_empty()),
            locked: apart.map_or(Vec::new(), |d| {
                d.locked.iter().map(|l| called(&l.parts)).collect()
            }),
            steps: steps_in(assembly, names).into_iter().map(|s| s.0).collect(),
        }
    }
}

/// The steps in which an assembly goes together: words, what moves, what stays, and the path in.
fn steps_in(
    assembly: &Assembly,
    names: &[String],
) -> Vec<(String, Vec<usize>, Vec<usize>, PathResult)> {
    let Some(apart) = &assembly.disassembly else {
        return Vec::new();
    };
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let step = |s: &pegfit_path::DisassemblyStep| {
        let path = s.path.clone().reversed();
        let named = |parts: &[usize]| parts.iter().map(|p| names[*p]).collect::<Vec<_>>();
        let said = format!(
            "{} onto {}: {}",
            named(&s.parts).join(" + "),
            named(&s.rest).join(", "),
            words(&path.motions, &Placement::default())
        );
        (said, s.parts.clone(), s.rest.clone(), path)
    };
    apart.steps.iter().rev().map(step).collect()
}

/// A page that puts the parts together.
fn page(title: &str, assembly: &Assembly, parts: &[LoosePart]) -> String {
    let names: Vec<String> = parts.iter().map(|p| p.name.clone()).collect();
    let place = |p: &Pose, mesh: &TriangleMesh| mesh.transformed(p.rotation, p.translation);
    // By their place in the assembly.
    let index = |part: &usize| assembly.placed.iter().position(|p| p.part == *part);
    let meshes: Vec<TriangleMesh> = (assembly.placed.iter())
        .map(|p| place(&p.pose, &parts[p.part].mesh))
        .collect();
    let shown: Vec<&TriangleMesh> = meshes.iter().collect();
    let steps = steps_in(assembly, &names);
    let acts = steps
        .iter()
        .enumerate()
        .map(|(i, (said, moving, rest, path))| Act {
            said: format!("{}. {said}", i + 1),
            moving: moving.iter().filter_map(index).collect(),
            staying: rest.iter().filter_map(index).collect(),
            poses: poses(path, &Placement::default()),
        });
    let player = Player {
        towards: "in",
        parts: &shown,
        acts: acts.collect(),
        start: 0,
    };
    path::page(&format!("How it goes together: {title}"), &player, "")
}

/// Prints the best assembly and what else there is.
fn print(found: &AssemblyResult, names: &[String], scene: &Path) {
    let Some(best) = found.assemblies.first() else {
        return;
    };
    say!(
        "{} of {} parts placed, score {:.1}; {} pairs of shapes docked in {:.1} s, put together in \
         {:.1} s",
        best.placed.len(),
        names.len(),
        best.score,
        found.pairs.len(),
        found.pair_seconds,
        found.seconds - found.pair_seconds
    );
    for mate in &best.mates {
        let [fixed, moving] = mate.parts.map(|p| names[p].as_str());
        say!(
            "  {moving} on {fixed}: {} ({:.1} nats, {:.1} mm²)",
            mate.joint.kind.name(),
            mate.information,
            1e6 * mate.area
        );
    }
    for part in &best.left_over {
        say!("  {} is left over: contact holds it nowhere", names[*part]);
    }
    match &best.disassembly {
        Some(apart) => {
            let steps = steps_in(best, names);
            say!("goes together in {} steps:", steps.len());
            for (i, (said, ..)) in steps.iter().enumerate() {
                say!("  {}. {said}", i + 1);
            }
            for locked in &apart.locked {
                let parts: Vec<&str> = locked.parts.iter().map(|p| names[*p].as_str()).collect();
                say!("  {} do not come apart as they lie", parts.join(", "));
            }
        }
        None => say!("not taken apart: no order is known"),
    }
    if let (Some(margin), false) = (found.margin, found.is_certain()) {
        say!(
            "Not certain: another assembly is worth only {margin:.1} less; see the report, --top 3."
        );
    }
    say!(
        "wrote {}; `pegfit play {}` opens it",
        scene.display(),
        scene.display()
    );
}
