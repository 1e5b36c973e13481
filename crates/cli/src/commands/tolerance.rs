//! Tables and lattices for a requested tolerance, with messages about the choice.

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::tolerance::{LATTICE_SHARE, Limit, TRIALS, TolerantDirect, TolerantPlan, Trial};
use pegfit_scene::{SceneError, SceneSetup};

use crate::bytes::display_bytes;
use crate::context::Context;
use crate::error::CommandError;

/// Designs the table of a scene for `tolerance`, the rms error of the force as a share of the rms
/// force.
pub(super) fn choose(
    setup: &SceneSetup,
    tolerance: f64,
    context: &Context,
) -> Result<TolerantPlan, CommandError> {
    let progress = &context.progress;
    let found = setup.design_for(tolerance, progress, &mut |trial| {
        progress.note(&trial_text(&trial));
    });
    progress.finish();
    found.map_err(|e| tolerance_error(e, Some(LATTICE_SHARE)))
}

/// Direct quadrature with errors of force and torque within `tolerance` at some of `poses`, of the
/// shapes.
pub(super) fn choose_direct(
    setup: &SceneSetup,
    poses: &[Pose],
    tolerance: f64,
    context: &Context,
) -> Result<TolerantDirect, CommandError> {
    let progress = &context.progress;
    let found = setup.direct_for(poses, tolerance, progress, &mut |trial| {
        progress.note(&trial_text(&trial));
    });
    progress.finish();
    found.map_err(|e| tolerance_error(e, None))
}

/// `share` is that of the tolerance that the lattice may use.
fn tolerance_error(error: SceneError, share: Option<f64>) -> CommandError {
    match error {
        SceneError::Tolerance {
            path,
            asked,
            reached,
            limit,
        } => tolerance_missed(&path, [asked, reached], share, &limit),
        other => other.into(),
    }
}

/// Text of a trial.
fn trial_text(trial: &Trial) -> String {
    match trial {
        Trial::Lattice { spacing, error } => format!(
            "spacing {:.4} mm: error {:.3} %",
            1e3 * spacing,
            100.0 * error
        ),
        Trial::Step { step_deg, error } => format!(
            "rotation step {step_deg:.3} degrees: error {:.3} %",
            100.0 * error
        ),
    }
}

fn tolerance_missed(
    scene: &Path,
    [asked, reached]: [f64; 2],
    share: Option<f64>,
    limit: &Limit,
) -> CommandError {
    let of_which = share.map(|s| format!("of which the lattice may use {:.0} %, ", 100.0 * s));
    let of_which = of_which.unwrap_or_default();
    let (lattice, step) = ("the lattice", "the rotation step");
    let (part, reason) = match *limit {
        Limit::Spacings { best } => (
            lattice,
            format!("at a spacing of {:.4} mm, of {TRIALS} tried", 1e3 * best),
        ),
        Limit::LatticeMemory {
            best,
            next,
            what,
            needed,
            limit,
        } => (
            lattice,
            format!(
                "{}at a spacing of {:.4} mm; half of {:.4} mm, \
                 to compare with, would need {} for {}: {what}, and {} can be used",
                of_which,
                1e3 * best,
                1e3 * next,
                display_bytes(needed),
                scene.display(),
                display_bytes(limit)
            ),
        ),
        Limit::Steps { best } => (step, format!("at {best:.3} degrees, of {TRIALS} tried")),
        Limit::TableMemory {
            best,
            next,
            needed,
            limit,
        } => {
            let needed = match needed {
                Some(bytes) => display_bytes(u64::try_from(bytes).unwrap_or(u64::MAX)),
                None => "more nodes than any table may have".to_owned(),
            };
            let limit = display_bytes(limit);
            (
                step,
                format!(
                    "at {best:.3} degrees; {next:.3} would need {needed}, and {limit} can be used"
                ),
            )
        }
    };
    CommandError::tolerance(part, [asked, reached], &reason)
}
