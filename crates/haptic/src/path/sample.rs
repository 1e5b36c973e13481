//! What one tick leaves behind for logs, plots and viewers.

use fft_correlate::{Pose, Wrench};

use crate::device::contract::DeviceState;
use crate::path::passivity::EnergyAccount;

/// Bits of [`Sample::flags`].
pub mod flags {
    /// The device is gone or has given nothing yet.
    pub const NO_INPUT: u16 = 1;
    /// The input was not finite or not a rotation.
    pub const BAD_INPUT: u16 = 1 << 1;
    /// The input is too old.
    pub const STALE: u16 = 1 << 2;
    /// The input moved faster than a hand can.
    pub const JUMP: u16 = 1 << 3;
    /// The tick came too late.
    pub const LATE: u16 = 1 << 4;
    /// The energy source gave a number that is not finite.
    pub const BAD_SOURCE: u16 = 1 << 5;
    /// The wrench was not finite and became zero.
    pub const NOT_FINITE: u16 = 1 << 6;
    /// A magnitude limit cut the wrench.
    pub const CLAMPED: u16 = 1 << 7;
    /// A rate limit cut the wrench.
    pub const SLEWED: u16 = 1 << 8;
    /// The passivity controller added damping.
    pub const DAMPED: u16 = 1 << 9;
    /// The device did not take the wrench.
    pub const NOT_SENT: u16 = 1 << 10;

    /// The energy source was exchanged: a part was loaded, reloaded or unloaded, or began or ceased
    /// to be [`NOT_LOADED`].
    pub const CHANGED: u16 = 1 << 11;
    /// Deadlines were left out before this tick because the one before took too long.
    pub const OVERRUN: u16 = 1 << 12;
    /// A part in reach, or rotations of its table that matter here, are not in memory: the part
    /// pushes nothing.
    pub const NOT_LOADED: u16 = 1 << 13;

    /// The part is outside the table, where its energy fades: what is felt is not the parts' own
    /// force.
    pub const OUTSIDE: u16 = 1 << 14;

    /// Names in the order of the bits.
    pub const NAMES: [&str; 15] = [
        "no_input",
        "bad_input",
        "stale",
        "jump",
        "late",
        "bad_source",
        "not_finite",
        "clamped",
        "slewed",
        "damped",
        "not_sent",
        "changed",
        "overrun",
        "not_loaded",
        "outside",
    ];
}

/// The record of one tick: input, object, wrench, energy and faults.
///
/// ```
/// use fft_correlate::{EnergySource, Pose};
/// use glam::DVec3;
/// use haptic::*;
///
/// let config = HapticConfig::default();
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let source = SumSource::new(DVec3::ZERO, vec![]); // free space
/// let spec = OperatorConfig::default().spec();
/// let mut path = ForcePath::new(&spec, &config, workspace, source.scratch())?;
/// // The device gives no input: no force, and the sample says why.
/// let sample = path.step(&source, None, 0.0, config.period());
/// assert_eq!(sample.flags & flags::NO_INPUT, flags::NO_INPUT);
/// assert_eq!((sample.gain, sample.wrench.force), (0.0, DVec3::ZERO));
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Counts from 0.
    pub tick: u64,
    /// The loop's clock, seconds.
    pub time: f64,
    /// Seconds since the last tick.
    pub dt: f64,
    /// The device's input, unchanged, device frame.
    pub input: Option<DeviceState>,
    /// Pose of the virtual object: the moving part, scene frame.
    pub object: Pose,
    /// Energy of the scene at `object`, joules.
    pub energy: f64,
    /// 1 inside the source's domain, 0 outside.
    pub coverage: f64,
    /// Torque and force sent to the device, device frame, N·m and N.
    pub wrench: Wrench,
    /// Strength of the force, 0 ..= 1.
    pub gain: f64,
    /// Energy bookkeeping up to this tick.
    pub account: EnergyAccount,
    /// Times the energy source was asked.
    pub evaluations: u32,
    /// Bits of [`flags`].
    pub flags: u16,
}
