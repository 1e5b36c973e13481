//! The devices that the service has, looked at or held.

use crate::device::contract::{Device, DeviceError};
use crate::device::haply::opened::list;
use crate::device::haply::options::InverseOptions;
use crate::device::haply::servo::Inverse;
use crate::device::haply::socket::{NAME, Socket};
use crate::device::info::{Access, DeviceInfo, DeviceKind};
use crate::device::servo::device::ServoDevice;

/// Every device of the service; none is taken, so one that somebody holds is not disturbed.
///
/// # Errors
/// If the service does not answer, speaks another language, or sees no device.
pub fn find(options: &InverseOptions) -> Result<Vec<DeviceInfo>, DeviceError> {
    let (mut socket, first) = Socket::connect(options.address)?;
    socket.close();
    let listed = list(&first);
    if listed.is_empty() {
        return Err(DeviceError::NotReady {
            name: NAME.into(),
            reason: "it runs, but sees no device; is one plugged in?".into(),
        });
    }
    let infos = listed.into_iter().map(|listed| DeviceInfo {
        path: format!("{}:{}", DeviceKind::Haply.word(), listed.id),
        usb: None,
        serial: listed.id,
        name: listed.spec.name.clone(),
        kind: DeviceKind::Haply,
        spec: listed.spec,
        access: match listed.ready {
            Ok(()) => Access::Ready,
            Err(why) => Access::Failed(why.to_string()),
        },
    });
    Ok(infos.collect())
}

/// Opens the device as the loop wants it.
///
/// # Errors
/// As [`find`], and if it is not calibrated or somebody else holds it.
pub fn open(options: InverseOptions) -> Result<Box<dyn Device>, DeviceError> {
    let inverse = Inverse::new(options);
    Ok(Box::new(ServoDevice::spawn(Box::new(inverse))?))
}
