//! A session recorded from a HID device gives the same ticks again.

use std::sync::atomic::AtomicBool;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;

use crate::config::HapticConfig;
use crate::device::contract::Device;
use crate::device::hid::fake::{Fake, unhex};
use crate::device::hid::pid;
use crate::device::hid::port::HidInput;
use crate::device::hid::spacemouse::{SpaceMouse, SpaceMouseSettings, spec};
use crate::device::threaded::{Cursor, ThreadedDevice};
use crate::path::force_path::ForcePath;
use crate::path::sample::{Sample, flags};
use crate::run::pace::Clock;
use crate::run::session::Session;

/// A spring to the origin.
struct Spring;

impl EnergySource for Spring {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        Response {
            energy: 50.0 * pose.translation.length_squared(),
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: pose.translation * -100.0,
            },
            coverage: 1.0,
        }
    }
}

/// What the loop computed of a tick, without what only a device and a clock know.
fn computed(sample: &Sample) -> Sample {
    Sample {
        flags: sample.flags & !(flags::NOT_SENT | flags::OVERRUN),
        ..*sample
    }
}

fn replays(device: &mut dyn Device) {
    let config = HapticConfig {
        ramp_s: 0.05,
        ..HapticConfig::default()
    };
    let workspace = config.workspace(Pose::IDENTITY, DVec3::new(0.0, 0.01, 0.02));
    let samples = Session::new(config.clone(), workspace)
        .keep_samples()
        .run(device, &Spring, Clock::Real, 0.3, &AtomicBool::new(false))
        .unwrap()
        .samples;
    assert!(samples.iter().any(|s| s.wrench.force.length() > 0.1));
    let mut path = ForcePath::new(device.spec(), &config, workspace, Spring.scratch()).unwrap();
    for sample in &samples {
        let again = path.step(&Spring, sample.input.as_ref(), sample.time, sample.dt);
        assert_eq!(computed(&again), computed(sample), "tick {}", sample.tick);
    }
}

#[test]
fn a_session_with_a_joystick_replays_bit_by_bit() {
    let descriptor = unhex(include_str!("../../../descriptors/pid-two-axes.hex"));
    let mut given = 0;
    let fake = Fake::new(descriptor, move |id| match id {
        0x12 => {
            given += 1;
            vec![0x12, given, 1, 0x00, 0x10]
        }
        _ => vec![0x13, 0x00, 0x10, 8, 0b01],
    });
    // Two places in turn, as of a hand that trembles.
    let there = [0x01, 0x81, 0xff, 0x3f, 0x00, 0x10];
    let here = [0x01, 0x01, 0xf0, 0x3f, 0x10, 0x10];
    fake.lock().input = (0..200)
        .flat_map(|_| [there.to_vec(), here.to_vec()])
        .collect();
    fake.lock().rest = there.to_vec();
    let (input, output) = (fake.connector(), fake.connector());
    let mut device = pid::open("fake", input, output, pid::PidSettings::default()).unwrap();
    replays(&mut device);
}

#[test]
fn a_session_with_a_spacemouse_replays_bit_by_bit() {
    let fake = Fake::new(Vec::new(), |_| Vec::new());
    // Pushed to the right by half, and turned a little.
    fake.lock().rest = vec![1, 175, 0, 0, 0, 0, 0, 60, 0, 0, 0, 0, 0];
    let input = HidInput::new(
        fake.connector(),
        SpaceMouse::new(SpaceMouseSettings::default()),
    );
    let mut device =
        ThreadedDevice::spawn(spec("mouse"), Cursor::default(), Box::new(input), None).unwrap();
    replays(&mut device);
}
