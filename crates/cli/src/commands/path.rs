//! `pegfit path`: how does the part get to where it fits?

use std::path::Path;
use std::time::Duration;

use fft_correlate::dock::Ranking;
use fft_correlate::{
    DirectOptions, DockingRequest, EnergySource, Pose, TiledEvaluator, WatchedTiles,
};
use pegfit_path::{Outcome, PathRequest, PathResult, PathSearch, Start, VisitedPoses};
use pegfit_scene::SceneSetup;
use sdf_grid::atomic;

use crate::args::PathArgs;
use crate::commands::scenes::parse_pose;
use crate::commands::{dock, resume, scenes};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::require_folder;
use crate::report::path::{PathReport, print};
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
    let scene = scenes::read(&args.scene.file, args.scene.fixed.as_deref())?;
    let setup = scenes::setup(scene, context)?;
    let request = request(args, &setup)?;
    let goal = setup.placement().to_shapes(&goal.pose(&setup, context)?);
    let parts = &setup.parts;
    let search = PathSearch::new(parts.fixed.clone(), parts.moving.clone(), request)?;
    let tiles = match args.solids_only {
        true => None,
        false => Some(setup.tiles(&DirectOptions::FULL, &context.progress)?),
    };
    context.progress.finish();
    let source = tiles.as_ref().map(|tiles| tiles.watched(&context.progress));
    let asked = source.as_ref().map(|s| s as &dyn EnergySource);
    let found = search.find_from(&goal, asked, &mut visited, &context.progress);
    context.progress.finish();
    let found = resume::after(args.resume.as_deref(), found, is_decided, &visited);
    if let Some(failure) = source.as_ref().and_then(WatchedTiles::failure) {
        return Err(setup.tile_error(failure.clone()).into());
    }
    let found = found?;
    let report = PathReport {
        result: found,
        name: setup.scene.moving.name.clone(),
        fixed: parts.fixed.clone(),
        moving: parts.moving.clone(),
        placement: *setup.placement(),
        unit: setup.display_unit(),
        field_seconds: tiles.as_ref().map(TiledEvaluator::load_seconds),
    };
    write(args, &report, to_stdout)?;
    context.show(&report.summary(), || {
        if !to_stdout {
            print(&report);
        }
    })
}

/// Whether a search need not go on.
fn is_decided(result: &PathResult) -> bool {
    match result.outcome {
        Outcome::Free => true,
        Outcome::Blocked { exhausted, .. } => exhausted,
    }
}

fn write(args: &PathArgs, report: &PathReport, to_stdout: bool) -> Result<(), CommandError> {
    match &args.output {
        // Refused writes are reported at the end.
        Some(_) if to_stdout => drop(report.csv(StandardOutput)),
        Some(file) => atomic::write_with(file, |out| {
            report
                .csv(out)
                .map_err(|e| CommandError::failure(file.display().to_string(), e))
        })?,
        None => {}
    }
    if let Some(file) = &args.png {
        match report.png()? {
            Some(bytes) => atomic::write(file, &bytes)?,
            None => remark!("no path to draw: {} is not written", file.display()),
        }
    }
    if let Some(file) = &args.html {
        atomic::write(file, report.html()?.as_bytes())?;
    }
    Ok(())
}

/// Longest search, seconds: a week.
const LONGEST: f64 = 604_800.0;

/// The goal of a path, as written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Goal {
    Fit,
    Best,
    Pose(Pose),
}

impl Goal {
    pub(super) fn parse(text: &str) -> Result<Self, CommandError> {
        match text {
            "fit" => Ok(Self::Fit),
            "best" => Ok(Self::Best),
            _ => parse_pose("--to", "fit, best", text).map(Self::Pose),
        }
    }

    /// The pose in the scene; docks if it has to.
    pub(super) fn pose(self, setup: &SceneSetup, context: &Context) -> Result<Pose, CommandError> {
        match self {
            Self::Fit => Ok(setup.scene.fit.assembled),
            Self::Pose(pose) => Ok(pose),
            Self::Best => {
                // The deepest pose leans on no wall; one that contact holds may, within its play.
                let options = DockingRequest {
                    top: 1,
                    ranking: Ranking::Energy,
                    ..setup.docking_options()
                };
                let found = dock::find_poses(setup, options, context)?;
                let best = found.poses.first().ok_or_else(|| {
                    let expected = "a scene in which docking finds a pose";
                    CommandError::option("--to best", expected, "none")
                })?;
                Ok(setup.placement().to_scene(&best.found.pose))
            }
        }
    }
}

/// The request; lengths become metres, poses those of the shapes.
pub(super) fn request(args: &PathArgs, setup: &SceneSetup) -> Result<PathRequest, CommandError> {
    let metre = setup.scene.unit.in_metres();
    let start = match args.from.as_str() {
        "outside" => Start::Outside,
        text => {
            let pose = parse_pose("--from", "outside", text)?;
            Start::Pose(setup.placement().to_shapes(&pose))
        }
    };
    Ok(PathRequest {
        tolerance: args.tolerance.map(|t| t * metre),
        step: args.step.map(|s| s * metre),
        time_limit: time_limit(args.seconds)?,
        start,
        allow_overlap: args.allow_overlap,
        ..PathRequest::default()
    })
}

pub(crate) fn time_limit(seconds: f64) -> Result<Duration, CommandError> {
    match seconds > 0.0 && seconds <= LONGEST {
        true => Ok(Duration::from_secs_f64(seconds)),
        false => {
            let expected = "a positive number of seconds, a week at most";
            refuse("--seconds", expected, seconds)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn goals_are_words_or_seven_numbers() {
        assert_eq!(Goal::parse("fit").unwrap(), Goal::Fit);
        assert_eq!(Goal::parse("best").unwrap(), Goal::Best);
        let goal = Goal::parse("-0.1,0, 2e-3,0,0,0,1").unwrap();
        let expected = Pose::from_translation(DVec3::new(-0.1, 0.0, 2e-3));
        assert_eq!(goal, Goal::Pose(expected));
        for wrong in ["", "here", "1,2,3", "0,0,0,0,0,0,2", "0,0,nan,0,0,0,1"] {
            let said = Goal::parse(wrong).unwrap_err().to_string();
            assert!(said.contains("--to") && said.contains("qw"), "{said}");
        }
        assert!(time_limit(f64::NAN).is_err() && time_limit(0.0).is_err());
    }
}
