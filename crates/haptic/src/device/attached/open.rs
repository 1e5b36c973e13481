//! Opening what was found.

use crate::device::contract::{Device, DeviceError};
use crate::device::hid::pid::settings::PidSettings;
use crate::device::hid::spacemouse::Feel;
use crate::device::info::{DeviceInfo, DeviceKind};
use crate::device::{force_dimension, haply, hid, openhaptics};

/// Opens an attached device as the loop wants it; of the settings, those of its kind count.
///
/// # Errors
/// If it is gone, may not be opened, is not ready, or is not what it was listed as.
pub fn open(
    info: &DeviceInfo,
    feel: Feel,
    settings: PidSettings,
) -> Result<Box<dyn Device>, DeviceError> {
    let own = info.path.split_once(':').map_or("", |(_, own)| own);
    match info.kind {
        DeviceKind::OpenHaptics => {
            let named = (own != "Default Device").then_some(own);
            openhaptics::open(openhaptics::PhantomOptions::of_system(named))
        }
        DeviceKind::ForceDimension => {
            let index = own.parse().map_err(|_| DeviceError::Unsuitable {
                name: info.path.clone(),
                expected: "a place in the library's list".into(),
                found: own.to_owned(),
            })?;
            force_dimension::open(force_dimension::DhdOptions {
                index,
                serial: info.serial.parse().ok(),
                ..force_dimension::DhdOptions::of_system()
            })
        }
        DeviceKind::Haply => haply::open(haply::InverseOptions::of_system(Some(own))?),
        DeviceKind::ForceFeedback | DeviceKind::SpaceMouse => hid::open_with(info, feel, settings),
    }
}
