//! `pegfit assemble`: puts loose parts together.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use fft_correlate::{Placement, Pose};
use pegfit_assemble::{
    Assembly, AssemblyError, AssemblyRequest, AssemblyResult, AssemblySearch, LoosePart,
};
use pegfit_scene::{SolidSet, shell_word, unique_name};
use sdf_grid::{LengthUnit, TriangleMesh, atomic};

use crate::args::AssembleArgs;
use crate::commands::assemble_export::{require_other, write_exports};
use crate::commands::part_files::{named_files, read_file};
use crate::commands::path::time_limit;
use crate::commands::scenes::parse_pose;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::assembly::{AssemblyReport, steps_in};
use crate::report::output::require_folder;
use crate::report::path;
use crate::report::player::{Act, Player, poses};
use crate::terminal::progress::interrupted;

pub(super) fn run(args: &AssembleArgs, context: &Context) -> Result<(), CommandError> {
    let report_file = (args.report.clone()).unwrap_or_else(|| args.output.with_extension("json"));
    let outputs = [
        &args.html,
        &args.glb,
        &args.exploded,
        &args.urdf,
        &args.mjcf,
    ];
    let named = [&args.output, &report_file];
    for file in outputs.into_iter().flatten().chain(named) {
        require_folder(file)?;
    }
    let files = named_files(&args.parts)?;
    for file in [&args.glb, &args.exploded].into_iter().flatten() {
        require_other(file, &files)?;
    }
    let (parts, unit) = read_parts(args, &files)?;
    let names: Vec<String> = parts.iter().map(|p| p.name.clone()).collect();
    let request = request(args, &names)?;
    let mut search = AssemblySearch::new(parts.clone(), request)?;
    if let Some(file) = &args.resume {
        search = search.resume(file)?;
    }
    let found = search.run(&context.progress);
    context.progress.finish();
    let found = found?;
    if found.assemblies.is_empty() {
        return Err(AssemblyError::NothingFits.into());
    }
    let report = AssemblyReport {
        result: found,
        names,
    };
    let text =
        (report.json()).map_err(|e| CommandError::failure(report_file.display().to_string(), e))?;
    atomic::write(&report_file, text.as_bytes())?;
    let best = &report.result.assemblies[0];
    write_scene(&args.output, best, &parts, unit)?;
    if let Some(file) = &args.html {
        let title = args.output.file_stem().unwrap_or_default();
        let page = page(&title.to_string_lossy(), best, &parts);
        atomic::write(file, page.as_bytes())?;
    }
    write_exports(args, best, &parts, &files)?;
    context.show(&report.summary(), || {
        print(&report.result, &report.names, &args.output);
    })?;
    match interrupted() {
        true => {
            let scene = args.output.display();
            let again = match &args.resume {
                Some(file) => format!("; the same command goes on from {}", file.display()),
                None => String::new(),
            };
            let kept = format!("what was put together so far is in {scene}{again}");
            Err(CommandError::stopped(kept))
        }
        false => Ok(()),
    }
}

/// The parts of all files that are wanted, each in its own frame, and the unit of the first file.
fn read_parts(
    args: &AssembleArgs,
    files: &[PathBuf],
) -> Result<(Vec<LoosePart>, LengthUnit), CommandError> {
    let each_solid = args.solids || files.len() == 1;
    let mut parts: Vec<LoosePart> = Vec::new();
    let mut names = BTreeSet::new();
    let mut unit = None;
    for file in files {
        let (solids, stated) = read_file(file, each_solid, args.unit, &args.reading)?;
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
    if !found.is_certain() {
        say!("Not certain: another assembly may be as good; see the report, --top 3.");
        if let Some(margin) = found.margin {
            say!("  the next one that was found is worth {margin:.1} nats less");
        }
        if best.shortfall > 0.0 {
            let short = best.shortfall;
            say!("  a part is held by {short:.1} nats less than in its best place on a single one");
        }
    }
    say!(
        "wrote {}; `pegfit play {}` opens it",
        scene.display(),
        shell_word(scene)
    );
}
