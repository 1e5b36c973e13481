//! The command, step by step.

use std::path::Path;
use std::time::Instant;

use fft_correlate::{DirectEvaluator, DirectOptions, EnergySource};
use pegfit_path::{Outcome, PathResult, PathSearch, VisitedPoses};
use pegfit_scene::SceneSetup;
use sdf_grid::atomic;

use super::question::{Goal, options, time_limit};
use crate::args::PathArgs;
use crate::commands::{resume, scenes};
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::{print_json, require_folder};
use crate::report::way::WayReport;
use crate::report::way::summary::say;
use crate::terminal::output::StandardOutput;

pub(crate) fn run(args: &PathArgs, context: &Context) -> Result<(), CommandError> {
    let to_stdout = args.output.as_deref() == Some(Path::new("-"));
    let files = [&args.output, &args.png, &args.html, &args.resume];
    for file in files
        .into_iter()
        .flatten()
        .filter(|f| **f != *Path::new("-"))
    {
        require_folder(file)?;
    }
    let goal = Goal::parse(&args.to)?;
    time_limit(args.seconds)?;
    let mut visited: VisitedPoses = resume::read(args.resume.as_deref())?;
    let scene = scenes::read(&args.scene, args.fixed.as_deref())?;
    let setup = scenes::setup(scene, context)?;
    let options = options(args, &setup)?;
    let goal = setup.placement().to_shapes(&goal.pose(&setup, context)?);
    let parts = &setup.parts;
    let search = PathSearch::new(parts.fixed.clone(), parts.moving.clone(), options)?;
    let (source, field_seconds) = match args.solids_only {
        true => (None, None),
        false => energies(&setup, context).map(|(e, s)| (Some(e), Some(s)))?,
    };
    let asked = source.as_ref().map(|s| s as &dyn EnergySource);
    let found = search.find_from(&goal, asked, &mut visited, &context.progress);
    context.progress.finish();
    let found = resume::after(args.resume.as_deref(), found, is_decided, &visited)?;
    let way = WayReport {
        answer: found,
        name: setup.scene.moving.name.clone(),
        fixed: parts.fixed.clone(),
        moving: parts.moving.clone(),
        placement: *setup.placement(),
        unit: setup.display_unit(),
        field_seconds,
    };
    write(args, &way, to_stdout)?;
    if context.json {
        print_json(&way.summary())
    } else if !to_stdout {
        say(&way);
        Ok(())
    } else {
        Ok(())
    }
}

/// Whether a search need not go on.
fn is_decided(answer: &PathResult) -> bool {
    match answer.outcome {
        Outcome::Free => true,
        Outcome::Blocked { exhausted, .. } => exhausted,
    }
}

/// What gives energies at poses of the shapes, and how many seconds its fields took.
fn energies(setup: &SceneSetup, context: &Context) -> Result<(DirectEvaluator, f64), CommandError> {
    let began = Instant::now();
    let pair = setup.pair(&context.progress)?;
    context.progress.finish();
    let source = setup.direct(&pair, &DirectOptions::FULL)?;
    Ok((source, began.elapsed().as_secs_f64()))
}

fn write(args: &PathArgs, way: &WayReport, to_stdout: bool) -> Result<(), CommandError> {
    match &args.output {
        // What is refused is told at the end.
        Some(_) if to_stdout => drop(way.csv(StandardOutput)),
        Some(file) => atomic::write_with(file, |out| {
            way.csv(out)
                .map_err(|e| CommandError::failure(file.display().to_string(), e))
        })?,
        None => {}
    }
    if let Some(file) = &args.png {
        match way.png()? {
            Some(bytes) => atomic::write(file, &bytes)?,
            None => crate::remark!("no way to draw: {} is not written", file.display()),
        }
    }
    if let Some(file) = &args.html {
        atomic::write(file, way.html()?.as_bytes())?;
    }
    Ok(())
}
