use fft_correlate::Wrench;
use glam::DVec3;

use super::*;
use crate::device::contract::Device;
use crate::device::hid::fake::{Fake, unhex, wait_for};

const TWO_AXES: &str = include_str!("../../../descriptors/pid-two-axes.hex");

/// A two-axis joystick with room for so many effects: x at its greatest, y in the middle, buttons
/// 1 and 8.
fn joystick(room: u8) -> Fake {
    let mut given = 0;
    let fake = Fake::new(unhex(TWO_AXES), move |id| match id {
        0x12 if given < room => {
            given += 1;
            vec![0x12, given, 1, 0x00, 0x10]
        }
        0x12 => vec![0x12, 0, 2, 0x00, 0x00],
        0x13 => vec![0x13, 0x00, 0x10, room, 0b01],
        other => unreachable!("no feature report {other}"),
    });
    fake.lock().rest = vec![0x01, 0x81, 0xff, 0x7f, 0x00, 0x00];
    fake
}

fn opened(fake: &Fake) -> Result<ThreadedDevice, DeviceError> {
    opened_with(fake, PidSettings::default())
}

fn opened_with(fake: &Fake, settings: PidSettings) -> Result<ThreadedDevice, DeviceError> {
    open("fake", fake.connector(), fake.connector(), settings)
}

fn push(x: f64, y: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, y, 0.0),
        ..Wrench::ZERO
    }
}

fn set_effect(block: u8, axis: u8) -> Vec<u8> {
    let mut report = vec![
        0x01, block, 1, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0xff, 0xff, axis,
    ];
    report.extend([0; 8]);
    report
}

#[test]
fn a_device_is_set_up_report_by_report_and_left_without_force() {
    let fake = joystick(8);
    drop(opened(&fake).unwrap());
    let sent = fake.take_sent();
    let expected = [
        vec![0x0c, 0x08],
        vec![0x0c, 0x01],
        vec![0x0d, 0xff],
        vec![0x11, 1, 0, 0],
        set_effect(1, 0b01),
        vec![0x11, 1, 0, 0],
        set_effect(2, 0b10),
        // Dropped: no force, everything stopped, blocks freed.
        vec![0x05, 1, 0, 0],
        vec![0x05, 2, 0, 0],
        vec![0x0c, 0x04],
        vec![0x0b, 1],
        vec![0x0b, 2],
    ];
    assert_eq!(sent, expected);
}

#[test]
fn a_device_that_answers_slowly_is_not_waited_for_again_and_again() {
    let fake = joystick(8);
    let layout = PidLayout::parse("fake", &unhex(TWO_AXES)).unwrap();
    let mut output = PidOutput {
        name: "fake".into(),
        connector: fake.connector(),
        port: None,
        layout,
        settings: PidSettings::default(),
        effects: Vec::new(),
    };
    let mut port = (fake.connector())().unwrap();
    let told = output.prepare(port.as_mut(), Instant::now()).unwrap_err();
    assert!(told.to_string().contains("no effect within 5s"), "{told}");
    let later = Instant::now() + SETUP;
    assert_eq!(output.prepare(port.as_mut(), later), Ok(()));
}

#[test]
fn forces_become_magnitudes_and_effects_start_once() {
    let fake = joystick(8);
    let mut device = opened(&fake).unwrap();
    fake.take_sent();
    device.send(&push(2.5, -5.0)).unwrap();
    wait_for(|| fake.lock().sent.len() >= 4);
    assert_eq!(
        fake.take_sent()[..4],
        [
            vec![0x05, 1, 0x88, 0x13],
            vec![0x0a, 1, 1, 0xff],
            vec![0x05, 2, 0xf0, 0xd8],
            vec![0x0a, 2, 1, 0xff],
        ]
    );
    device.stop_all().unwrap();
    let stopped = fake.take_sent();
    assert_eq!(stopped.last(), Some(&vec![0x0c, 0x04]));
    assert!(stopped.contains(&vec![0x05, 1, 0, 0]));
}

#[test]
fn the_scale_and_the_signs_are_the_settings() {
    let fake = joystick(8);
    let settings = PidSettings {
        max_force: 10.0,
        signs: [1.0, -1.0, 1.0],
        ..PidSettings::default()
    };
    let mut device = opened_with(&fake, settings).unwrap();
    assert_eq!(device.spec().max_force, 10.0);
    fake.take_sent();
    device.send(&push(2.5, -5.0)).unwrap();
    wait_for(|| fake.lock().sent.len() >= 4);
    let sent = fake.take_sent();
    assert_eq!(sent[0], [0x05, 1, 0xc4, 0x09]);
    assert_eq!(sent[2], [0x05, 2, 0x88, 0x13]);
}

#[test]
fn magnitudes_round_clamp_and_are_never_made_of_nan() {
    let layout = PidLayout::parse("stick", &unhex(TWO_AXES)).unwrap();
    for (share, magnitude) in [
        (0.0, 0),
        (1.0, 10_000),
        (-1.0, -10_000),
        (1e300, 10_000),
        (0.123_456, 1235),
        (f64::NAN, 0),
    ] {
        assert_eq!(layout.magnitude(share), magnitude, "{share}");
    }
}

#[test]
fn the_record_and_the_input_follow_the_descriptor() {
    let mut device = opened(&joystick(8)).unwrap();
    let spec = device.spec().clone();
    assert_eq!((spec.input_dof, spec.output_dof), (3, 2));
    wait_for(|| device.poll(0.0).is_ok());
    let state = device.poll(0.0).unwrap();
    assert_eq!(state.buttons, 0x81);
    assert!((state.pose.translation.x - 0.1).abs() < 1e-12);
    // Halfway between -32767 and 32767.
    assert!(state.pose.translation.y.abs() < 1e-12);
    crate::device::conformance::check(&mut device).unwrap();
}

#[test]
fn a_state_report_moves_nothing() {
    let layout = PidLayout::parse("stick", &unhex(TWO_AXES)).unwrap();
    assert_eq!(layout.reading(&[0x02, 0x1f], 0.2), None);
    assert_eq!(layout.reading(&[], 0.2), None);
    assert_eq!(layout.reading(&[0x01, 0, 0], 0.2), None);
}

#[test]
fn too_little_room_is_told_and_what_was_made_is_freed() {
    // The pool says so at once; without a pool report, block load does.
    let pool = opened(&joystick(1)).err().unwrap().to_string();
    assert!(pool.contains("1 effects at once for 2 axes"), "{pool}");
    let mut given = 0;
    let fake = Fake::new(unhex(TWO_AXES), move |id| match id {
        0x12 => {
            given += 1;
            vec![0x12, given, given, 0, 0]
        }
        _ => vec![0x13], // too short to say anything
    });
    let full = opened(&fake).err().unwrap().to_string();
    assert!(full.contains("full effect pool"), "{full}");
    assert_eq!(fake.take_sent().last(), Some(&vec![0x0b, 1]));
}

#[test]
fn a_pool_that_the_host_must_manage_is_refused() {
    let fake = Fake::new(unhex(TWO_AXES), |_| vec![0x13, 0, 0x10, 8, 0]);
    let error = opened(&fake).err().unwrap().to_string();
    assert!(error.contains("host must manage"), "{error}");
}

#[test]
fn a_slow_block_load_is_waited_for_and_a_silent_one_is_not_for_ever() {
    let mut asked = 0;
    let fake = Fake::new(unhex(TWO_AXES), move |id| {
        asked += 1;
        match id {
            0x12 if asked % 5 != 0 => vec![0x12, 0, 0, 0, 0],
            0x12 => vec![0x12, asked / 5, 1, 0, 0],
            _ => vec![0x13, 0, 0x10, 8, 1],
        }
    });
    fake.lock().rest = vec![0x01, 0, 0, 0, 0, 0];
    opened(&fake).unwrap();
    let mute = Fake::new(unhex(TWO_AXES), |id| vec![id, 0, 0, 0, 1]);
    let error = opened(&mute).err().unwrap().to_string();
    assert!(error.contains("block load answer"), "{error}");
}

#[test]
fn a_joystick_without_motors_is_refused() {
    let mut stick = unhex(TWO_AXES)[..42].to_vec();
    stick.push(0xc0);
    let error = PidLayout::parse("stick", &stick).unwrap_err().to_string();
    assert!(error.contains("stick") && error.contains("set"), "{error}");
    assert!(PidLayout::parse("noise", &[0xff; 7]).is_err());
}

#[test]
fn a_device_comes_back_and_is_set_up_again() {
    let fake = joystick(200);
    let mut device = opened(&fake).unwrap();
    wait_for(|| device.poll(0.0).is_ok());
    fake.take_sent();
    // A force that stays the same: only its being sent again shows that nobody takes it.
    wait_for(|| device.send(&push(1.0, 0.0)).is_ok() && fake.lock().sent.len() >= 4);
    fake.lock().plugged = false;
    wait_for(|| device.poll(0.0) == Err(DeviceError::Disconnected));
    wait_for(|| device.send(&push(1.0, 0.0)) == Err(DeviceError::Disconnected));
    fake.take_sent();
    fake.lock().plugged = true;
    wait_for(|| device.poll(0.0).is_ok() && device.send(&push(1.0, 0.0)).is_ok());
    let sent = fake.take_sent();
    assert_eq!(sent[0], [0x0c, 0x08]);
    assert!(sent.contains(&set_effect(3, 0b01)), "{sent:02x?}");
}
