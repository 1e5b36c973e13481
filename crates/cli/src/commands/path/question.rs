//! From arguments to a goal and what is asked of the way there.

use std::time::Duration;

use fft_correlate::{DockingOptions, Pose};
use glam::{DQuat, DVec3};
use pegfit_path::{PathRequest, Start};
use pegfit_scene::SceneSetup;

use crate::args::PathArgs;
use crate::commands::dock;
use crate::context::Context;
use crate::error::CommandError;

/// Longest search, seconds: a week.
const LONGEST: f64 = 604_800.0;

/// Where a way is to lead, as written.
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
            _ => pose("--to", "fit, best", text).map(Self::Pose),
        }
    }

    /// The pose in the scene; docks if it has to.
    pub(super) fn pose(self, setup: &SceneSetup, context: &Context) -> Result<Pose, CommandError> {
        match self {
            Self::Fit => Ok(setup.scene.fit.assembled),
            Self::Pose(pose) => Ok(pose),
            Self::Best => {
                let options = DockingOptions {
                    top: 1,
                    ..setup.docking_options()
                };
                let found = dock::look(setup, options, context)?;
                let best = found.poses.first().ok_or_else(|| {
                    let expected = "a scene in which docking finds a pose";
                    CommandError::option("--to best", expected, "none")
                })?;
                Ok(setup.placement().to_scene(&best.found.pose))
            }
        }
    }
}

/// What is asked of the way; lengths become metres, poses those of the shapes.
pub(super) fn options(args: &PathArgs, setup: &SceneSetup) -> Result<PathRequest, CommandError> {
    let metre = setup.scene.unit.in_metres();
    let start = match args.from.as_str() {
        "outside" => Start::Outside,
        text => {
            let pose = pose("--from", "outside", text)?;
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
            Err(CommandError::option("--seconds", expected, seconds))
        }
    }
}

/// A pose written as seven numbers.
fn pose(option: &str, words: &str, text: &str) -> Result<Pose, CommandError> {
    let refused = || {
        let expected = format!("{words}, or x,y,z,qx,qy,qz,qw in metres");
        CommandError::option(option, expected, text)
    };
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|_| refused())?;
    let [x, y, z, qx, qy, qz, qw] = numbers[..] else {
        return Err(refused());
    };
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let usable = numbers.iter().all(|v| v.is_finite()) && (rotation.length() - 1.0).abs() < 1e-3;
    usable
        .then(|| Pose::new(rotation, DVec3::new(x, y, z)))
        .ok_or_else(refused)
}

#[cfg(test)]
mod tests {
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
