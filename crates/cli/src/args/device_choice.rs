//! Which device holds the moving part, as typed after `--device`.

use std::path::PathBuf;
use std::str::FromStr;

use haptic::device::hid::{DeviceInfo, DeviceKind};

/// A device, or how to find one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A mass, spring and damper that follows a script: no hardware needed.
    Simulated,
    /// What is attached, force feedback first; the simulated hand if nothing is.
    Auto,
    /// The inputs of a log again.
    Replay(PathBuf),
    /// An attached device of this kind.
    Attached(DeviceKind, Which),
}

/// Which of several devices of a kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Which {
    /// The first, by path.
    First,
    /// The one with this path, serial number or `vendor:product`.
    Named(String),
}

impl Which {
    /// Whether it means this device.
    pub fn means(&self, device: &DeviceInfo) -> bool {
        let Self::Named(name) = self else {
            return true;
        };
        *name == device.path || *name == device.serial || *name == device.ids()
    }
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, rest) = match text.split_once(':') {
            Some((kind, rest)) => (kind, Some(rest)),
            None => (text, None),
        };
        let which = rest.map_or(Which::First, |name| Which::Named(name.to_owned()));
        match (kind, rest) {
            (_, Some("")) => Err(format!("nothing after `{kind}:`")),
            ("simulated", None) => Ok(Self::Simulated),
            ("auto", None) => Ok(Self::Auto),
            ("replay", Some(path)) => Ok(Self::Replay(path.into())),
            ("spacemouse", _) => Ok(Self::Attached(DeviceKind::SpaceMouse, which)),
            ("pid", _) => Ok(Self::Attached(DeviceKind::ForceFeedback, which)),
            _ => Err(
                "expected simulated, auto, replay:LOG.csv, spacemouse or pid; the last two \
                 may name one by path, serial number or vendor:product, as in \
                 pid:/dev/hidraw3"
                    .into(),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_is_understood_and_others_are_not() {
        let choice = |text: &str| text.parse::<DeviceChoice>();
        assert_eq!(choice("simulated"), Ok(DeviceChoice::Simulated));
        assert_eq!(choice("auto"), Ok(DeviceChoice::Auto));
        assert_eq!(
            choice("replay:a:b.csv"),
            Ok(DeviceChoice::Replay("a:b.csv".into()))
        );
        assert_eq!(
            choice("pid:1209:ffb0"),
            Ok(DeviceChoice::Attached(
                DeviceKind::ForceFeedback,
                Which::Named("1209:ffb0".into())
            ))
        );
        assert_eq!(
            choice("spacemouse"),
            Ok(DeviceChoice::Attached(DeviceKind::SpaceMouse, Which::First))
        );
        for wrong in ["", "pid:", "replay", "auto:x", "simulated:1", "joystick"] {
            assert!(choice(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_name_is_a_path_a_serial_number_or_ids() {
        let device = DeviceInfo {
            path: "/dev/hidraw3".into(),
            vendor: 0x046d,
            product: 0xc626,
            serial: "SN42".into(),
            name: "SpaceNavigator".into(),
            kind: DeviceKind::SpaceMouse,
            spec: haptic::device::hid::spacemouse::spec("SpaceNavigator"),
            access: haptic::device::hid::Access::Ready,
        };
        for name in ["/dev/hidraw3", "SN42", "046d:c626"] {
            assert!(Which::Named(name.into()).means(&device), "{name}");
        }
        assert!(Which::First.means(&device));
        assert!(!Which::Named("046d".into()).means(&device));
    }
}
