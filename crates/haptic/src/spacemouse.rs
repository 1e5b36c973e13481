//! 3Dconnexion devices: six axes in, no force out.
//!
//! Axes on the wire, from the user's seat: x right, y towards the user, z down, rotations about the
//! same axes right-handed. Ours, everywhere in this crate: x right, y away from the user, z up, so
//! y and z change sign, of translations and of rotation vectors alike. (Drivers differ: spacenavd
//! swaps y and z instead, PySpaceMouse names rotations by their own signs.)

use std::time::Duration;

use fft_correlate::Twist;
use glam::DVec3;

use crate::hid::{Connector, HidPort};
use crate::io_thread::{InputHalf, Motion, Reading};
use crate::{DeviceError, DeviceSpec};

/// Vendor, product and name of every 3Dconnexion device known to send these reports.
pub const MODELS: [(u16, u16, &str); 21] = [
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
    (0x256f, 0xc62e, "SpaceMouse Wireless, cabled"),
    (0x256f, 0xc62f, "SpaceMouse Wireless receiver"),
    (0x256f, 0xc631, "SpaceMouse Pro Wireless, cabled"),
    (0x256f, 0xc632, "SpaceMouse Pro Wireless receiver"),
    (0x256f, 0xc633, "SpaceMouse Enterprise"),
    (0x256f, 0xc635, "SpaceMouse Compact"),
    (0x256f, 0xc636, "SpaceMouse Module"),
    (0x256f, 0xc638, "SpaceMouse Pro Wireless Bluetooth"),
    (0x256f, 0xc63a, "SpaceMouse Wireless Bluetooth"),
    (0x256f, 0xc652, "Universal receiver"),
];

/// Counts at full deflection. Some caps reach 500: those are full too.
const FULL: f64 = 350.0;

/// Name of a known device.
pub fn model(vendor: u16, product: u16) -> Option<&'static str> {
    MODELS
        .iter()
        .find(|m| (m.0, m.1) == (vendor, product))
        .map(|m| m.2)
}

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

/// How deflections become speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feel {
    /// m/s at full deflection.
    pub speed: f64,
    /// rad/s at full deflection.
    pub angular_speed: f64,
    /// Share of the full deflection that counts as none, 0 .. 1. The speed rises from zero at its
    /// edge.
    pub dead_zone: f64,
}

impl Default for Feel {
    fn default() -> Self {
        Self {
            speed: 0.1,
            angular_speed: 1.0,
            dead_zone: 0.05,
        }
    }
}

impl Feel {
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
    fn take(&mut self, report: Report, feel: &Feel) {
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

/// The reading half; give it to [`crate::io_thread::Threaded::spawn`].
pub struct SpaceMouse {
    connector: Connector,
    port: Option<Box<dyn HidPort>>,
    feel: Feel,
    state: Deflection,
}

impl SpaceMouse {
    /// A device reached through `connector`.
    pub fn new(connector: Connector, feel: Feel) -> Self {
        Self {
            connector,
            port: None,
            feel,
            state: Deflection::default(),
        }
    }
}

impl InputHalf for SpaceMouse {
    fn connect(&mut self) -> Result<(), DeviceError> {
        self.port = None;
        self.state = Deflection::default();
        self.port = Some((self.connector)()?);
        Ok(())
    }

    fn read(&mut self, timeout: Duration) -> Result<Option<Reading>, DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        let mut buffer = [0; 64];
        let length = port.read(&mut buffer, timeout)?;
        if length == 0 {
            return Ok(None);
        }
        self.state.take(parse(&buffer[..length]), &self.feel);
        Ok(Some(Reading {
            motion: Motion::Rate(self.state.twist),
            buttons: self.state.buttons,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_split_layout() {
        // X +350, Y -350, Z +1.
        let translation = [0x01, 0x5e, 0x01, 0xa2, 0xfe, 0x01, 0x00];
        assert_eq!(parse(&translation), Report::Translation([350, -350, 1]));
        let rotation = [0x02, 0x00, 0x00, 0x00, 0x00, 0x0c, 0xfe];
        assert_eq!(parse(&rotation), Report::Rotation([0, 0, -500]));
    }

    #[test]
    fn reads_the_combined_layout_buttons_and_battery() {
        let both = [1, 0x5e, 0x01, 0, 0, 0, 0, 0xff, 0xff, 0, 0, 0x02, 0x00];
        assert_eq!(parse(&both), Report::Both([350, 0, 0], [-1, 0, 2]));
        assert_eq!(parse(&[3, 0x02, 0x80]), Report::Buttons(0x8002));
        assert_eq!(parse(&[3, 1, 0, 0, 0x80]), Report::Buttons(0x8000_0001));
        assert_eq!(parse(&[0x17, 88, 0]), Report::Battery(88));
    }

    #[test]
    fn short_or_strange_reports_are_nothing() {
        for bytes in [&[][..], &[1], &[1, 2, 3, 4, 5, 6], &[2, 0], &[0x42; 20]] {
            assert_eq!(parse(bytes), Report::Other, "{bytes:?}");
        }
        assert_eq!(parse(&[3]), Report::Buttons(0));
    }

    #[test]
    fn axes_point_right_away_and_up_with_a_dead_zone() {
        let feel = Feel::default();
        let mut state = Deflection::default();
        // Pushed right, pulled towards the user, pressed down.
        state.take(Report::Translation([350, 350, 350]), &feel);
        assert_eq!(state.twist.linear, DVec3::new(0.1, -0.1, -0.1));
        state.take(Report::Rotation([500, 0, -17]), &feel);
        assert_eq!(state.twist.angular, DVec3::new(1.0, 0.0, 0.0).abs());
        let just_outside = feel.axis(18);
        assert!(just_outside > 0.0 && just_outside < 0.01);
    }

    #[test]
    fn every_model_has_its_own_ids() {
        for (i, a) in MODELS.iter().enumerate() {
            assert!(MODELS[i + 1..].iter().all(|b| (a.0, a.1) != (b.0, b.1)));
        }
        assert_eq!(model(0x046d, 0xc626), Some("SpaceNavigator"));
        assert_eq!(model(0x046d, 0xc077), None);
    }

    /// Pushed right to the full, in the split layout; two reports, then silence.
    struct FakePort(std::vec::IntoIter<Vec<u8>>);

    impl HidPort for FakePort {
        fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, DeviceError> {
            let Some(report) = self.0.next() else {
                std::thread::sleep(timeout);
                return Ok(0);
            };
            buffer[..report.len()].copy_from_slice(&report);
            Ok(report.len())
        }

        fn write(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            unreachable!("an input device is never written")
        }

        fn set_feature(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            unreachable!("an input device is never written")
        }

        fn get_feature(&mut self, _: &mut [u8]) -> Result<usize, DeviceError> {
            unreachable!("an input device is never asked")
        }

        fn descriptor(&mut self) -> Result<Vec<u8>, DeviceError> {
            unreachable!("its layouts are known")
        }
    }

    #[test]
    fn as_a_device_it_steers_a_cursor_and_passes_the_conformance_suite() {
        use crate::Device;
        use crate::io_thread::{Cursor, Threaded};
        let reports = vec![vec![3, 2], vec![1, 0x5e, 0x01, 0, 0, 0, 0]];
        let connector: Connector =
            Box::new(move || Ok(Box::new(FakePort(reports.clone().into_iter()))));
        let mouse = SpaceMouse::new(connector, Feel::default());
        let mut device =
            Threaded::spawn(spec("mouse"), Cursor::default(), Box::new(mouse), None).unwrap();
        crate::conformance::check(&mut device).unwrap();
        let start = device.poll(1.0).unwrap();
        let end = device.poll(1.05).unwrap();
        assert_eq!(start.buttons, 2);
        let moved = end.pose.translation.x - start.pose.translation.x;
        assert!((moved - 0.1 * 0.05).abs() < 1e-12, "{moved}");
    }
}
