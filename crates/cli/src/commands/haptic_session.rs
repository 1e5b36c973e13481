//! Running the haptic loop on a scene.

use std::path::Path;

use fft_correlate::EnergySource;
use haptic::log::SampleWriter;
use haptic::{
    Clock, Device, GuidedJoint, HapticError, OperatorConfig, Outcome, RecordError, Replay, Script,
    Session, SimulatedOperator,
};
use pegfit_scene::Assembly;

use crate::commands::scenes::scene_item;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::parquet_log;
use crate::terminal::progress::cancel_flag;

/// [`run`] with the simulated hand, which follows `script`; every sample is in the outcome.
pub(super) fn run_simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
    clock: Clock,
) -> Result<Outcome, CommandError> {
    let mut hand = simulated(assembly, source, script, seconds);
    let options = LoopOptions {
        log: None,
        samples: true,
        joints: Vec::new(),
    };
    run(assembly, source, &mut hand, seconds, clock, options)
}

/// The simulated hand at the start of `script`.
pub(super) fn simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
) -> SimulatedOperator {
    let hand = OperatorConfig {
        duration: seconds,
        ..OperatorConfig::default()
    };
    let geometry = assembly.geometry(source);
    SimulatedOperator::new(hand, script, geometry, assembly.workspace())
}

/// What a run keeps and follows.
pub(super) struct LoopOptions {
    /// Every tick goes to a file.
    pub(super) log: Option<Box<dyn SampleWriter>>,
    /// Every tick is in the outcome.
    pub(super) samples: bool,
    /// A joint that the part follows, in all places that are alike.
    pub(super) joints: Vec<GuidedJoint>,
}

/// Runs the loop for `seconds` on `clock`.
pub(super) fn run(
    assembly: &Assembly,
    source: &dyn EnergySource,
    device: &mut dyn Device,
    seconds: f64,
    clock: Clock,
    options: LoopOptions,
) -> Result<Outcome, CommandError> {
    session(assembly, options)
        .run(device, source, clock, seconds, cancel_flag())
        .map_err(|e| loop_error(assembly, e))
}

/// Runs the loop at the times of a recording, for `seconds` of it.
pub(super) fn replay(
    assembly: &Assembly,
    source: &dyn EnergySource,
    recorded: &mut Replay,
    seconds: f64,
    options: LoopOptions,
) -> Result<Outcome, CommandError> {
    session(assembly, options)
        .replay(recorded, source, seconds, cancel_flag())
        .map_err(|e| loop_error(assembly, e))
}

fn session(assembly: &Assembly, options: LoopOptions) -> Session {
    let session = Session::new(assembly.scene().device.clone(), assembly.workspace());
    let session = session.guided(options.joints);
    let session = match options.log {
        Some(log) => session.record_with(log),
        None => session,
    };
    match options.samples {
        true => session.keep_samples(),
        false => session,
    }
}

/// Creates a log, CSV or, if it ends so, Parquet, and says where it is until the run has ended.
pub(super) fn log(path: &Path, context: &Context) -> Result<Box<dyn SampleWriter>, CommandError> {
    let log = match parquet_log::is_parquet(path) {
        true => parquet_log::create(path)?,
        false => haptic::log::create_csv(path).map_err(|e| match e {
            RecordError::Io { path, source } => CommandError::write(&path, source),
            other => CommandError::failure(path.display().to_string(), other),
        })?,
    };
    let part = log.path();
    if part != path {
        context.progress.note(&format!(
            "the log grows in {}, which stays if the run does not end well",
            part.display()
        ));
    }
    Ok(log)
}

fn loop_error(assembly: &Assembly, error: HapticError) -> CommandError {
    match error {
        HapticError::Config(_) => {
            CommandError::bad_input(scene_item(assembly.scene(), "device"), error)
        }
        other => CommandError::failure("haptic loop", other),
    }
}
