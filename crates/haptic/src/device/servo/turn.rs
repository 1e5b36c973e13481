//! What passes between a device and its servo thread.

use fft_correlate::{Pose, Twist};

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::servo::link::Link;

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

/// A device as its servo thread has it. All calls come from that thread.
pub(crate) trait Servo: Send {
    /// Opens it (again) and makes it ready to push, without force; says what it can do.
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError>;

    /// Exchanges wrenches and inputs by `link` until told to quit or until the device fails; on
    /// return the device is without force and closed.
    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError>;
}
