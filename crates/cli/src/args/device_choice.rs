//! Which device holds the moving part, as typed after `--device`.

use std::path::PathBuf;
use std::str::FromStr;

use haptic::device::info::{DeviceInfo, DeviceKind};

/// A device, or how to find one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum DeviceChoice {
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
pub(crate) enum Which {
    /// The first.
    First,
    /// The one that is called so: path, driver's name, serial number or `vendor:product`.
    Named(String),
}

impl Which {
    /// Whether it means this device.
    pub(crate) fn means(&self, device: &DeviceInfo) -> bool {
        self.name().is_none_or(|name| device.is_called(name))
    }

    /// What was typed.
    pub(crate) fn name(&self) -> Option<&str> {
        match self {
            Self::First => None,
            Self::Named(name) => Some(name),
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (word, rest) = match text.split_once(':') {
            Some((word, rest)) => (word, Some(rest)),
            None => (text, None),
        };
        if rest == Some("") {
            return Err(format!("nothing after `{word}:`"));
        }
        let attached = DeviceKind::ALL.into_iter().find(|k| k.word() == word);
        match (word, rest, attached) {
            (_, rest, Some(kind)) => {
                let which = rest.map_or(Which::First, |name| Which::Named(name.to_owned()));
                Ok(Self::Attached(kind, which))
            }
            ("simulated", None, _) => Ok(Self::Simulated),
            ("auto", None, _) => Ok(Self::Auto),
            ("replay", Some(path), _) => Ok(Self::Replay(path.into())),
            _ => Err(format!(
                "expected simulated, auto, replay:LOG.csv or one of {}; these may name one of \
                 several by path, driver's name, serial number or vendor:product, as in \
                 pid:/dev/hidraw3",
                DeviceKind::ALL.map(DeviceKind::word).join(", ")
            )),
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
        assert_eq!(
            choice("openhaptics:Left Hand"),
            Ok(DeviceChoice::Attached(
                DeviceKind::OpenHaptics,
                Which::Named("Left Hand".into())
            ))
        );
        for kind in DeviceKind::ALL {
            let first = DeviceChoice::Attached(kind, Which::First);
            assert_eq!(choice(kind.word()), Ok(first));
        }
        for wrong in [
            "",
            "pid:",
            "haply:",
            "replay",
            "auto:x",
            "simulated:1",
            "joystick",
        ] {
            assert!(choice(wrong).is_err(), "{wrong}");
        }
    }
}
