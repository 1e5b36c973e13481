//! 3Dconnexion devices: six axes in, no force out.
//!
//! Reports (numbers little-endian):
//!
//! ```text
//! split     01 X Y Z, then 02 RX RY RZ   7 bytes each, in turn    models before 2012, Compact
//! combined  01 X Y Z RX RY RZ            13 bytes                 wireless models, Enterprise
//! buttons   03 mask, up to 32 bits
//! battery   17 percent ...               wireless models
//! ```
//!
//! The length of each report decides its layout, not the model: the same ids have been seen with
//! both. While it is deflected a device reports all the time; one that falls silent out of
//! the middle has lost its radio link and counts as let go after [`SILENCE`].
//!
//! Axes on the wire, from the user's seat: x right, y towards the user, z down, rotations about the
//! same axes right-handed. Ours, everywhere in this crate: x right, y away from the user, z up, so
//! y and z change sign, of translations and of rotation vectors alike. (Drivers differ: spacenavd
//! swaps y and z instead, PySpaceMouse names rotations by their own signs.)

use std::time::Duration;

use fft_correlate::Twist;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::hid::port::{Decoder, HidPort};
use crate::device::threaded::{Motion, Reading};

/// Vendor, product and name of every 3Dconnexion device known to send these reports.
pub const MODELS: [(u16, u16, &str); 24] = [
    (0x046d, 0xc603, "SpaceMouse Plus"),
    (0x046d, 0xc605, "CADman"),
    (0x046d, 0xc606, "SpaceMouse Classic"),
    (0x046d, 0xc621, "SpaceBall 5000"),
    (0x046d, 0xc623, "SpaceTraveler"),
    (0x046d, 0xc625, "SpacePilot"),
    (0x046d, 0xc626, "SpaceNavigator"),
    (0x046d, 0xc627, "SpaceExplorer"),
    (0x046d, 0xc628, "SpaceNavigator for Notebooks"),
    (0x046d, 0xc629, "SpacePilot Pro"),
    (0x046d, 0xc62b, "SpaceMouse Pro"),
    (0x046d, 0xc640, "NuLOOQ"),
    (0x256f, 0xc62c, "SpaceMouse Touch"),
    (0x256f, 0xc62e, "SpaceMouse Wireless, cabled"),
    (0x256f, 0xc62f, "SpaceMouse Wireless receiver"),
    (0x256f, 0xc631, "SpaceMouse Pro Wireless, cabled"),
    (0x256f, 0xc632, "SpaceMouse Pro Wireless receiver"),
    (0x256f, 0xc633, "SpaceMouse Enterprise"),
    (0x256f, 0xc635, "SpaceMouse Compact"),
    (0x256f, 0xc636, "SpaceMouse Module"),
    (0x256f, 0xc638, "SpaceMouse Pro Wireless Bluetooth"),
    (0x256f, 0xc63a, "SpaceMouse Wireless Bluetooth"),
    (0x256f, 0xc641, "SpaceMouse Scout"),
    (0x256f, 0xc652, "Universal receiver"),
];

/// 3Dconnexion's own vendor id.
const VENDOR: u16 = 0x256f;

/// Usage page and usage of a 3D mouse: Generic Desktop, Multi-axis Controller.
const MULTI_AXIS: (u16, u16) = (0x01, 0x08);

/// Counts at full deflection. Some caps reach 500: those are full too.
const FULL: f64 = 350.0;

/// Name of a known device.
pub fn model(vendor: u16, product: u16) -> Option<&'static str> {
    MODELS
        .iter()
        .find(|m| (m.0, m.1) == (vendor, product))
        .map(|m| m.2)
}

/// Whether a device with these usages is one: a known model, or any other multi-axis controller of
/// the same maker. Gives the model's name where it is known. The keyboard and mouse that receivers
/// pretend to be as well are none; usages that cannot be read (0, 0) are believed.
pub fn recognise(vendor: u16, product: u16, usages: &[(u16, u16)]) -> Option<Option<&'static str>> {
    let known = model(vendor, product);
    let six_axes = usages.contains(&MULTI_AXIS);
    let unknown = usages.iter().all(|u| *u == (0, 0));
    let is = (known.is_some() && (six_axes || unknown)) || (vendor == VENDOR && six_axes);
    is.then_some(known)
}

/// Silence after which a deflected device counts as let go.
pub const SILENCE: Duration = Duration::from_millis(250);

/// One report, in wire axes and counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Report {
    /// Report 1, 7 bytes: translation.
    Translation([i16; 3]),
    /// Report 2, 7 bytes: rotation.
    Rotation([i16; 3]),
    /// Report 1, 13 bytes: both.
    Both([i16; 3], [i16; 3]),
    /// Report 3: a mask of up to 32 buttons.
    Buttons(u32),
    /// Report 0x17: battery, percent.
    Battery(u8),
    /// Anything else.
    Other,
}

/// Reads one report, whichever layout it has: split (translation and rotation in turn) or combined.
pub fn parse(bytes: &[u8]) -> Report {
    let axes = |first: usize| -> Option<[i16; 3]> {
        let b: &[u8; 6] = bytes.get(first..first + 6)?.try_into().ok()?;
        Some([
            i16::from_le_bytes([b[0], b[1]]),
            i16::from_le_bytes([b[2], b[3]]),
            i16::from_le_bytes([b[4], b[5]]),
        ])
    };
    match (bytes.first(), axes(1), axes(7)) {
        (Some(1), Some(t), Some(r)) => Report::Both(t, r),
        (Some(1), Some(t), None) => Report::Translation(t),
        (Some(2), Some(r), _) => Report::Rotation(r),
        (Some(3), ..) => {
            let mask = bytes[1..].iter().take(4).rev();
            Report::Buttons(mask.fold(0, |mask, byte| mask << 8 | u32::from(*byte)))
        }
        (Some(0x17), ..) if bytes.len() > 1 => Report::Battery(bytes[1]),
        _ => Report::Other,
    }
}

/// How deflections become speeds: the table `spacemouse` of a scene's `[device]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpaceMouseSettings {
    /// m/s of the device at full deflection, > 0. Default 0.1.
    pub speed: f64,
    /// rad/s at full deflection, > 0. Default 1.
    pub angular_speed: f64,
    /// Share of the full deflection that counts as none, 0 ..= 0.9. Default 0.05. The speed rises
    /// from zero at its edge.
    pub dead_zone: f64,
}

impl Default for SpaceMouseSettings {
    fn default() -> Self {
        Self {
            speed: 0.1,
            angular_speed: 1.0,
            dead_zone: 0.05,
        }
    }
}

impl SpaceMouseSettings {
    fn axis(&self, counts: i16) -> f64 {
        let x = f64::from(counts) / FULL;
        let beyond = (x.abs().min(1.0) - self.dead_zone).max(0.0);
        (beyond / (1.0 - self.dead_zone)).copysign(x)
    }

    fn vector(&self, counts: [i16; 3]) -> DVec3 {
        let [x, y, z] = counts.map(|c| self.axis(c));
        DVec3::new(x, -y, -z)
    }
}

/// What the reports so far add up to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Deflection {
    twist: Twist,
    buttons: u32,
}

impl Deflection {
    fn take(&mut self, report: Report, feel: &SpaceMouseSettings) {
        let translation = |t| feel.vector(t) * feel.speed;
        let rotation = |r| feel.vector(r) * feel.angular_speed;
        match report {
            Report::Translation(t) => self.twist.linear = translation(t),
            Report::Rotation(r) => self.twist.angular = rotation(r),
            Report::Both(t, r) => {
                self.twist = Twist {
                    angular: rotation(r),
                    linear: translation(t),
                };
            }
            Report::Buttons(mask) => self.buttons = mask,
            Report::Battery(_) | Report::Other => {}
        }
    }
}

/// The device record of all of them.
pub fn spec(name: &str) -> DeviceSpec {
    DeviceSpec {
        name: name.to_owned(),
        input_dof: 6,
        output_dof: 6,
        rate_controlled: true,
        max_force: f64::INFINITY,
        max_torque: f64::INFINITY,
        max_stiffness: f64::INFINITY,
        max_rotational_stiffness: f64::INFINITY,
        workspace: 0.4,
        nominal_rate: 125.0,
    }
}

/// The meaning of their reports; give it to [`HidInput`](crate::device::hid::HidInput).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SpaceMouse {
    feel: SpaceMouseSettings,
    state: Deflection,
}

impl SpaceMouse {
    /// A device at rest.
    pub fn new(feel: SpaceMouseSettings) -> Self {
        Self {
            feel,
            state: Deflection::default(),
        }
    }

    fn reading(&self) -> Reading {
        Reading {
            motion: Motion::Rate(self.state.twist),
            buttons: self.state.buttons,
        }
    }
}

impl Decoder for SpaceMouse {
    fn start(&mut self, _: &mut dyn HidPort) -> Result<(), DeviceError> {
        self.state = Deflection::default();
        Ok(())
    }

    fn decode(&mut self, report: &[u8]) -> Option<Reading> {
        let report = parse(report);
        self.state.take(report, &self.feel);
        match report {
            Report::Battery(_) | Report::Other => None,
            _ => Some(self.reading()),
        }
    }

    fn silence(&mut self, lasting: Duration) -> Option<Reading> {
        if lasting < SILENCE || self.state.twist == Twist::default() {
            return None;
        }
        self.state.twist = Twist::default();
        Some(self.reading())
    }
}

#[cfg(test)]
#[path = "spacemouse_tests.rs"]
mod tests;
