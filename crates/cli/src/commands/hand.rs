//! Running the haptic loop on a scene.

use std::path::Path;

use fft_correlate::EnergySource;
use haptic::{
    Clock, Device, HandConfig, HapticError, Outcome, Replay, Script, Session, SimulatedHand,
};
use pegfit_scene::Assembly;

use super::scenes::within;
use crate::error::CommandError;
use crate::report::parquet_log;
use crate::terminal::progress::cancel_flag;

/// [`run`] with the simulated hand, which follows `script`; every sample is in the outcome or, if
/// `log` is given, in that file instead.
pub(super) fn run_simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
    clock: Clock,
    log: Option<&Path>,
) -> Result<Outcome, CommandError> {
    let mut hand = simulated(assembly, source, script, seconds);
    let keep = Keep {
        log,
        samples: log.is_none(),
    };
    run(assembly, source, &mut hand, seconds, clock, keep)
}

/// The simulated hand at the start of `script`.
pub(super) fn simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
) -> SimulatedHand {
    let hand = HandConfig {
        duration: seconds,
        ..HandConfig::default()
    };
    let geometry = assembly.geometry(source);
    SimulatedHand::new(hand, script, geometry, assembly.workspace())
}

/// What is kept of every tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Keep<'a> {
    /// In a file: CSV, or Parquet if it ends so.
    pub(super) log: Option<&'a Path>,
    /// In the outcome.
    pub(super) samples: bool,
}

/// Runs the loop for `seconds` on `clock`.
pub(super) fn run(
    assembly: &Assembly,
    source: &dyn EnergySource,
    device: &mut dyn Device,
    seconds: f64,
    clock: Clock,
    keep: Keep<'_>,
) -> Result<Outcome, CommandError> {
    session(assembly, keep)?
        .run(device, source, clock, seconds, cancel_flag())
        .map_err(|e| told(assembly, e))
}

/// Runs the loop at the times of a recording, for `seconds` of it.
pub(super) fn replay(
    assembly: &Assembly,
    source: &dyn EnergySource,
    recorded: &mut Replay,
    seconds: f64,
    keep: Keep<'_>,
) -> Result<Outcome, CommandError> {
    session(assembly, keep)?
        .replay(recorded, source, seconds, cancel_flag())
        .map_err(|e| told(assembly, e))
}

fn session(assembly: &Assembly, keep: Keep<'_>) -> Result<Session, CommandError> {
    let session = Session::new(assembly.scene().device.clone(), assembly.workspace());
    let session = match keep.log {
        Some(path) if parquet_log::is_parquet(path) => {
            session.record_with(parquet_log::create(path)?)
        }
        Some(path) => session.record_to(path),
        None => session,
    };
    Ok(match keep.samples {
        true => session.keep_samples(),
        false => session,
    })
}

fn told(assembly: &Assembly, error: HapticError) -> CommandError {
    match error {
        HapticError::Config(_) => CommandError::bad_input(within(assembly, "device"), error),
        other => CommandError::failure("haptic loop", other),
    }
}
