//! Running the haptic loop on a scene.

use std::path::Path;

use fft_correlate::EnergySource;
use haptic::{
    Clock, Device, HandConfig, HapticError, Outcome, Script, Session, SimulatedHand, Workspace,
};

use crate::assembly::Assembly;
use crate::error::CommandError;
use crate::progress::cancel_flag;

/// [`run`] with the simulated hand, which follows `script`.
pub(super) fn run_simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
    clock: Clock,
    log: Option<&Path>,
) -> Result<Outcome, CommandError> {
    let mut hand = simulated(assembly, source, script, seconds);
    run(assembly, source, &mut hand, seconds, clock, log)
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
    SimulatedHand::new(hand, script, geometry, workspace(assembly))
}

/// Runs the loop for `seconds` on `clock`, with every sample in the outcome or, if `log` is given,
/// in that file instead.
pub(super) fn run(
    assembly: &Assembly,
    source: &dyn EnergySource,
    device: &mut dyn Device,
    seconds: f64,
    clock: Clock,
    log: Option<&Path>,
) -> Result<Outcome, CommandError> {
    let session = Session::new(assembly.scene.device.clone(), workspace(assembly));
    let session = match log {
        Some(path) => session.record_to(path),
        None => session.keep_samples(),
    };
    session
        .run(device, source, clock, seconds, cancel_flag())
        .map_err(|e| match e {
            HapticError::Config(_) => CommandError::bad_input(assembly.context("device"), e),
            other => CommandError::failure("haptic loop", other),
        })
}

fn workspace(assembly: &Assembly) -> Workspace {
    let config = &assembly.scene.device;
    config.workspace(assembly.assembled(), assembly.pair.pivot())
}
