//! What passes between a device and its servo thread.

use fft_correlate::{Pose, Twist};

use crate::device::contract::DeviceError;

/// Where a handle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Handle {
    /// Pose, device frame.
    pub(crate) pose: Pose,
    /// Velocity, device frame, rad/s and m/s.
    pub(crate) twist: Twist,
    /// Bit `i` is set while button `i` is held.
    pub(crate) buttons: u32,
}

/// What a device answers to a wrench.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Turn {
    /// Where the handle is; `None` while the device does not know.
    pub(crate) handle: Option<Handle>,
    /// Why the device took the force away by itself, if it did: too much of it, or warm motors.
    /// The force rises anew from nothing.
    pub(crate) refused: Option<DeviceError>,
}
