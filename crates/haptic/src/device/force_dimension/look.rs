//! The devices that the library has, looked at or held.

use std::sync::Arc;

use crate::device::contract::{Device, DeviceError};
use crate::device::force_dimension::api::Api;
use crate::device::force_dimension::opened::{Opened, unknown};
use crate::device::force_dimension::options::DhdOptions;
use crate::device::force_dimension::servo::Arm;
use crate::device::info::{Access, DeviceInfo, DeviceKind};
use crate::device::servo::device::ServoDevice;

/// Every device of the library, each opened for a moment; `options` says by which library. What
/// cannot be opened is listed too, and says why in [`DeviceInfo::access`].
///
/// # Errors
/// If the library is not installed, too old or lacks a function, or there is no device.
pub fn find(options: &DhdOptions) -> Result<Vec<DeviceInfo>, DeviceError> {
    let api = Arc::new(Api::load(options.library.clone())?);
    // SAFETY: takes nothing.
    let count = unsafe { (api.device_count)() };
    api.done(count, "Force Dimension SDK")?;
    if count == 0 {
        return Err(DeviceError::NotReady {
            name: "Force Dimension SDK".into(),
            reason: "it is installed, but sees no device: is one switched on and plugged in, and \
                     may this user open it (the SDK's udev rules)?"
                .into(),
        });
    }
    // Places are numbered by a signed byte.
    let places = 0..u8::try_from(count).unwrap_or(u8::MAX).min(127);
    Ok(places.map(|index| look(&api, index)).collect())
}

fn look(api: &Arc<Api>, index: u8) -> DeviceInfo {
    let opened = Opened::new(Arc::clone(api), index);
    let (spec, serial, ready) = match opened {
        Ok(opened) => (opened.spec(), opened.serial(), opened.ready()),
        Err(why) => (unknown(index), None, Err(why)),
    };
    DeviceInfo {
        path: format!("{}:{index}", DeviceKind::ForceDimension.word()),
        usb: None,
        serial: serial.map(|s| s.to_string()).unwrap_or_default(),
        name: spec.name.clone(),
        kind: DeviceKind::ForceDimension,
        spec,
        access: match ready {
            Ok(()) => Access::Ready,
            Err(why) => Access::Failed(why.to_string()),
        },
    }
}

/// Opens the device as the loop wants it, its weight borne by its own gravity compensation.
///
/// # Errors
/// As [`find`], and if it is not calibrated or not the one wanted.
pub fn open(options: DhdOptions) -> Result<Box<dyn Device>, DeviceError> {
    let arm = Arm::new(options);
    Ok(Box::new(ServoDevice::spawn(Box::new(arm))?))
}
