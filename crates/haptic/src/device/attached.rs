//! The devices of this machine, of every kind.

use serde::Serialize;

use crate::device::contract::{Device, DeviceError};
use crate::device::hid::pid::PidSettings;
use crate::device::hid::spacemouse::SpaceMouseSettings;
use crate::device::info::{DeviceInfo, DeviceKind};
use crate::device::{force_dimension, haply, hid, openhaptics};

/// The result of [`survey`].
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Survey {
    /// Devices, those that cannot be opened too.
    pub devices: Vec<DeviceInfo>,
    /// Kinds of which there is none because something is missing.
    pub missing: Vec<MissingDriver>,
}

/// Why there is no device of a kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissingDriver {
    /// The kind.
    pub kind: DeviceKind,
    /// The driver or service that is not installed; none if something else is missing.
    pub driver: Option<String>,
    /// What is missing, what was tried, and what would help.
    pub reason: String,
}

/// Finds devices of these kinds; `name` is the user's name for the wanted one. OpenHaptics cannot
/// list devices: its default device is tried, and before it the one of that name if no other kind
/// is asked for.
///
/// # Errors
/// If the system's list of HID devices cannot be read.
pub fn survey(kinds: &[DeviceKind], name: Option<&str>) -> Result<Survey, DeviceError> {
    let mut survey = Survey::default();
    let asked = |kind| kinds.contains(&kind);
    let mut add = |kind: DeviceKind, found: Result<Vec<DeviceInfo>, DeviceError>| match found {
        Ok(devices) => survey.devices.extend(devices),
        Err(why) => survey.missing.push(MissingDriver {
            kind,
            reason: why.to_string(),
            driver: match why {
                DeviceError::NotInstalled { name, .. } => Some(name),
                _ => None,
            },
        }),
    };
    if asked(DeviceKind::OpenHaptics) {
        let own = name.filter(|_| kinds.len() == 1);
        add(
            DeviceKind::OpenHaptics,
            find_openhaptics(own).map(|info| vec![info]),
        );
    }
    if asked(DeviceKind::ForceDimension) {
        let options = force_dimension::DhdOptions::from_env();
        add(DeviceKind::ForceDimension, force_dimension::find(&options));
    }
    if asked(DeviceKind::Haply) {
        let found = haply::InverseOptions::from_env(None).and_then(|options| haply::find(&options));
        add(DeviceKind::Haply, found);
    }
    if asked(DeviceKind::ForceFeedback) || asked(DeviceKind::SpaceMouse) {
        let found = hid::enumerate()?.into_iter();
        survey.devices.extend(found.filter(|info| asked(info.kind)));
    }
    Ok(survey)
}

/// The device of this name, else the default one, whose serial number it may be.
fn find_openhaptics(name: Option<&str>) -> Result<DeviceInfo, DeviceError> {
    let default = || openhaptics::find(&openhaptics::PhantomOptions::from_env(None));
    let Some(name) = name else {
        return default();
    };
    let own = name.strip_prefix("openhaptics:").unwrap_or(name);
    openhaptics::find(&openhaptics::PhantomOptions::from_env(Some(own))).or_else(|why| {
        let info = default()?;
        match info.is_called(name) {
            true => Ok(info),
            false => Err(why),
        }
    })
}

/// Opens an attached device as the loop wants it; of the settings, those of its kind count.
///
/// # Errors
/// If it is gone, may not be opened, is not ready, or is not what it was listed as.
pub fn open(
    info: &DeviceInfo,
    feel: SpaceMouseSettings,
    settings: PidSettings,
) -> Result<Box<dyn Device>, DeviceError> {
    let own = info.path.split_once(':').map_or("", |(_, own)| own);
    match info.kind {
        DeviceKind::OpenHaptics => {
            let named = (own != "Default Device").then_some(own);
            openhaptics::open(openhaptics::PhantomOptions::from_env(named))
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
                ..force_dimension::DhdOptions::from_env()
            })
        }
        DeviceKind::Haply => haply::open(haply::InverseOptions::from_env(Some(own))?),
        DeviceKind::ForceFeedback | DeviceKind::SpaceMouse => hid::open_with(info, feel, settings),
    }
}
