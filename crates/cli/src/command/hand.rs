//! Running the haptic loop with the simulated hand.

use std::path::Path;

use fft_correlate::EnergySource;
use haptic::{Clock, HandConfig, HapticError, Outcome, Script, Session, SimulatedHand};

use crate::assembly::Assembly;
use crate::error::CommandError;
use crate::progress::cancel_flag;

/// Runs `script` for `seconds` on `clock`, with every sample in the outcome or, if `log` is given,
/// in that file instead.
pub(super) fn run_simulated(
    assembly: &Assembly,
    source: &dyn EnergySource,
    script: Script,
    seconds: f64,
    clock: Clock,
    log: Option<&Path>,
) -> Result<Outcome, CommandError> {
    let config = assembly.scene.device.clone();
    let geometry = assembly.geometry(source);
    let workspace = config.workspace(assembly.assembled(), assembly.pair.pivot());
    let hand = HandConfig {
        duration: seconds,
        ..HandConfig::default()
    };
    let mut device = SimulatedHand::new(hand, script, geometry, workspace);
    let session = Session::new(config, workspace);
    let session = match log {
        Some(path) => session.record_to(path),
        None => session.keep_samples(),
    };
    session
        .run(&mut device, source, clock, seconds, cancel_flag())
        .map_err(|e| match e {
            HapticError::Config(_) => CommandError::bad_input(assembly.context("device"), e),
            other => CommandError::failure("haptic loop", other),
        })
}
