//! What is known of a device of this machine without holding it.

use std::fmt;

use serde::Serialize;

#[cfg(not(target_family = "wasm"))]
use crate::device::contract::DeviceError;
use crate::device::contract::DeviceSpec;

/// What a device of this machine can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A 3D Systems Touch or PHANTOM, by OpenHaptics.
    OpenHaptics,
    /// A Force Dimension device or a Novint Falcon, by the Force Dimension SDK.
    #[serde(rename = "force-dimension")]
    ForceDimension,
    /// A Haply Inverse3, by Haply's service.
    Haply,
    /// A USB HID PID device: pushes along its axes.
    ForceFeedback,
    /// A 3Dconnexion device: six axes, no force.
    SpaceMouse,
}

impl DeviceKind {
    /// All of them, in the order in which one is taken if any will do: force feedback first.
    pub const ALL: [Self; 5] = [
        Self::OpenHaptics,
        Self::ForceDimension,
        Self::Haply,
        Self::ForceFeedback,
        Self::SpaceMouse,
    ];

    /// How a command line calls it, such as `force-dimension`.
    pub fn word(self) -> &'static str {
        match self {
            Self::OpenHaptics => "openhaptics",
            Self::ForceDimension => "force-dimension",
            Self::Haply => "haply",
            Self::ForceFeedback => "pid",
            Self::SpaceMouse => "spacemouse",
        }
    }

    /// Where its maker offers the driver or service that it needs; none if the system has it.
    pub fn driver_page(self) -> Option<&'static str> {
        match self {
            Self::OpenHaptics => Some("https://www.3dsystems.com/haptics"),
            Self::ForceDimension => Some("https://www.forcedimension.com/software/sdk"),
            Self::Haply => Some("https://develop.haply.co/"),
            Self::ForceFeedback | Self::SpaceMouse => None,
        }
    }

    /// Who makes it, or the standard it follows.
    pub fn maker(self) -> &'static str {
        match self {
            Self::OpenHaptics => "3D Systems",
            Self::ForceDimension => "Force Dimension",
            Self::Haply => "Haply",
            Self::ForceFeedback => "USB HID PID",
            Self::SpaceMouse => "3Dconnexion",
        }
    }
}

/// Whether a device can be opened.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Access {
    /// It can.
    Ready,
    /// This user may not.
    Denied,
    /// Why not, and what would help.
    Failed(String),
}

/// The ids of a USB model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct UsbIds {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
}

impl fmt::Display for UsbIds {
    /// `vendor:product`, four hexadecimal digits each.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:04x}", self.vendor, self.product)
    }
}

/// A device that is attached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceInfo {
    /// Where the system has it, such as `/dev/hidraw3`; for a device of a maker's driver its kind's
    /// [`DeviceKind::word`] and the driver's name for it, such as `haply:049D`.
    pub path: String,
    /// USB ids of a HID device; makers' drivers have none.
    #[serde(flatten)]
    pub usb: Option<UsbIds>,
    /// Serial number, empty if it has none.
    pub serial: String,
    /// Model.
    pub name: String,
    /// What it can be.
    pub kind: DeviceKind,
    /// What it can do; forces of a HID PID device as
    /// [`PidSettings`](crate::device::hid::pid::PidSettings) has them by default.
    pub spec: DeviceSpec,
    /// Whether it can be opened.
    pub access: Access,
}

impl DeviceInfo {
    /// A device of a maker's driver, which calls it `id`; `ready` says why it cannot be opened.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn of_driver(
        kind: DeviceKind,
        id: &str,
        serial: String,
        spec: DeviceSpec,
        ready: Result<(), DeviceError>,
    ) -> Self {
        Self {
            path: format!("{}:{id}", kind.word()),
            usb: None,
            serial,
            name: spec.name.clone(),
            kind,
            spec,
            access: ready.map_or_else(|why| Access::Failed(why.to_string()), |()| Access::Ready),
        }
    }

    /// Whether a user who types `name` may mean it: its path, what follows the colon in it, its
    /// serial number or its USB ids.
    pub fn is_called(&self, name: &str) -> bool {
        let own = self.path.split_once(':').map(|(_, own)| own);
        let ids = self.usb.map(|ids| ids.to_string());
        !name.is_empty()
            && (self.path == name
                || own == Some(name)
                || self.serial == name
                || ids.as_deref() == Some(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_path_a_driver_s_name_a_serial_number_or_ids() {
        let mouse = DeviceInfo {
            path: "/dev/hidraw3".into(),
            usb: Some(UsbIds {
                vendor: 0x046d,
                product: 0xc626,
            }),
            serial: "SN42".into(),
            name: "SpaceNavigator".into(),
            kind: DeviceKind::SpaceMouse,
            spec: crate::device::hid::spacemouse::spec("SpaceNavigator"),
            access: Access::Ready,
        };
        for name in ["/dev/hidraw3", "SN42", "046d:c626"] {
            assert!(mouse.is_called(name), "{name}");
        }
        assert!(!mouse.is_called("046d"));
        let arm = DeviceInfo {
            path: "haply:049D".into(),
            usb: None,
            serial: String::new(),
            kind: DeviceKind::ForceDimension,
            ..mouse
        };
        assert!(arm.is_called("049D") && arm.is_called("haply:049D"));
        assert!(!arm.is_called("") && !arm.is_called("046d:c626"));
        let json = serde_json::to_value(&arm).unwrap();
        assert_eq!(
            (&json["kind"], json.get("vendor")),
            (&DeviceKind::ForceDimension.word().into(), None)
        );
    }
}
