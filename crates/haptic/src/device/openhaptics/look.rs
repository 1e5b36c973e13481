//! The device that the library has, looked at or held.

use crate::device::contract::{Device, DeviceError};
use crate::device::info::{Access, DeviceInfo, DeviceKind};
use crate::device::openhaptics::api::Api;
use crate::device::openhaptics::opened::{Found, Opened};
use crate::device::openhaptics::options::PhantomOptions;
use crate::device::openhaptics::servo::Phantom;
use crate::device::servo::device::ServoDevice;

/// The device, opened for a moment: the library cannot list devices otherwise.
///
/// # Errors
/// If the library is not installed or lacks a function, or the device cannot be opened at all. One
/// that only wants to be calibrated is listed, and says so in [`DeviceInfo::access`].
pub fn find(options: &PhantomOptions) -> Result<DeviceInfo, DeviceError> {
    let api = Api::load(options.library.clone())?;
    let mut opened = Opened::new(api, options)?;
    let Found { spec, serial } = opened.describe();
    Ok(DeviceInfo {
        path: format!("{}:{}", DeviceKind::OpenHaptics.word(), options.called()),
        usb: None,
        serial,
        name: spec.name.clone(),
        kind: DeviceKind::OpenHaptics,
        spec,
        access: match opened.calibrate() {
            Ok(()) => Access::Ready,
            Err(why) => Access::Failed(why.to_string()),
        },
    })
}

/// Opens the device as the loop wants it. The library can do so for one device of a process at a
/// time.
///
/// # Errors
/// As [`find`], and if it is not calibrated.
pub fn open(options: PhantomOptions) -> Result<Box<dyn Device>, DeviceError> {
    let phantom = Phantom::new(options);
    Ok(Box::new(ServoDevice::spawn(Box::new(phantom))?))
}
