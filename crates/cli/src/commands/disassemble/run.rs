//! The command, step by step.

use std::path::Path;

use fft_correlate::Placement;
use pegfit_path::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, DisassemblyStep,
    DisassemblyTries,
};
use pegfit_scene::{PlacedParts, Scene};
use sdf_grid::{TriangleMesh, atomic};

use super::summary::{Order, say, told};
use crate::args::DisassembleArgs;
use crate::commands::path::question::time_limit;
use crate::commands::{resume, scenes};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::{print_json, require_folder};
use crate::report::way::page::{Act, Played};
use crate::report::way::rows;

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
    scenes::tell(&placed.warnings, context);
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
    if context.json {
        print_json(&order)
    } else {
        say(&found, &names, placed.display_unit);
        Ok(())
    }
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
        said: format!("{}. {}", i + 1, told(step, names)),
        moving: step.parts.clone(),
        staying: step.rest.clone(),
        way: &step.path,
    });
    let played = Played {
        title: format!("How it comes apart: {title}"),
        towards: "out",
        parts: meshes,
        acts: acts.collect(),
        placement: Placement::default(),
        charts: String::new(),
    };
    played.html()
}

/// The way of each step, and the order.
fn write(
    folder: &Path,
    files: &[String],
    found: &DisassemblyResult,
    order: &Order,
) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder).map_err(|source| CommandError::Io {
        action: "write",
        path: folder.to_owned(),
        source,
    })?;
    for (file, step) in files.iter().zip(&found.steps) {
        let file = folder.join(file);
        atomic::write_with(&file, |out| {
            rows::write(&step.path, &Placement::default(), out)
                .map_err(|e| CommandError::failure(file.display().to_string(), e))
        })?;
    }
    let text = serde_json::to_string_pretty(order)
        .map_err(|e| CommandError::failure("writing JSON", e))?;
    Ok(atomic::write(&folder.join("order.json"), text.as_bytes())?)
}
