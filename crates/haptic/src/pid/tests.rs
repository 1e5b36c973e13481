use std::sync::{Arc, Mutex};

use super::*;

/// Report descriptor of a two-axis PID joystick with the report ids of OpenFFBoard, written down
/// from the HID 1.11 and PID 1.0 tables.
fn descriptor() -> Vec<u8> {
    let mut d: Vec<u8> = Vec::new();
    let mut add = |bytes: &[u8]| d.extend_from_slice(bytes);
    // Joystick: report 1, 8 buttons, X and Y of 16 bits.
    add(&[0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, 0x85, 0x01]);
    add(&[0x05, 0x09, 0x19, 0x01, 0x29, 0x08, 0x15, 0x00, 0x25, 0x01]);
    add(&[0x75, 0x01, 0x95, 0x08, 0x81, 0x02]);
    add(&[
        0x05, 0x01, 0x09, 0x30, 0x09, 0x31, 0x16, 0x01, 0x80, 0x26, 0xff, 0x7f,
    ]);
    add(&[0x75, 0x10, 0x95, 0x02, 0x81, 0x02]);
    add(&[0x05, 0x0f]);
    let block: &[u8] = &[
        0x09, 0x22, 0x15, 0x01, 0x25, 0x28, 0x75, 0x08, 0x95, 0x01, 0x91, 0x02,
    ];
    // Set Effect, output 1: block, type, four times, gain, trigger, axes, direction, offsets.
    add(&[0x09, 0x21, 0xa1, 0x02, 0x85, 0x01]);
    add(block);
    add(&[0x09, 0x25, 0xa1, 0x02, 0x09, 0x26, 0x09, 0x27, 0x09, 0x40]);
    add(&[0x15, 0x01, 0x25, 0x03, 0x91, 0x00, 0xc0]);
    add(&[0x09, 0x50, 0x09, 0x54, 0x09, 0x51, 0x09, 0xa7]);
    add(&[
        0x15, 0x00, 0x26, 0xff, 0x7f, 0x75, 0x10, 0x95, 0x04, 0x91, 0x02,
    ]);
    add(&[
        0x09, 0x52, 0x15, 0x00, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x01, 0x91, 0x02,
    ]);
    add(&[0x09, 0x53, 0x15, 0x01, 0x25, 0x08, 0x91, 0x02]);
    add(&[0x09, 0x55, 0xa1, 0x02, 0x05, 0x01, 0x09, 0x30, 0x09, 0x31]);
    add(&[
        0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x02, 0x91, 0x02, 0xc0,
    ]);
    add(&[
        0x05, 0x0f, 0x09, 0x56, 0x95, 0x01, 0x91, 0x02, 0x95, 0x05, 0x91, 0x03,
    ]);
    for collection in [0x57, 0x58] {
        add(&[0x09, collection, 0xa1, 0x02]);
        add(&[0x0b, 0x01, 0x00, 0x0a, 0x00, 0x0b, 0x02, 0x00, 0x0a, 0x00]);
        add(&[
            0x15, 0x00, 0x27, 0xa0, 0x8c, 0x00, 0x00, 0x75, 0x10, 0x95, 0x02, 0x91, 0x02, 0xc0,
        ]);
    }
    add(&[0xc0]);
    // Set Constant Force, output 5: block, magnitude -10000 ..= 10000.
    add(&[0x09, 0x73, 0xa1, 0x02, 0x85, 0x05]);
    add(block);
    add(&[
        0x09, 0x70, 0x16, 0xf0, 0xd8, 0x26, 0x10, 0x27, 0x75, 0x10, 0x95, 0x01, 0x91, 0x02,
    ]);
    add(&[0xc0]);
    // Effect Operation, output 10: block, start / start solo / stop, loop count.
    add(&[0x09, 0x77, 0xa1, 0x02, 0x85, 0x0a]);
    add(block);
    add(&[0x09, 0x78, 0xa1, 0x02, 0x09, 0x79, 0x09, 0x7a, 0x09, 0x7b]);
    add(&[0x15, 0x01, 0x25, 0x03, 0x91, 0x00, 0xc0]);
    add(&[0x09, 0x7c, 0x15, 0x00, 0x26, 0xff, 0x00, 0x91, 0x02, 0xc0]);
    // Device Control, output 12: a bit per command.
    add(&[0x09, 0x95, 0xa1, 0x02, 0x85, 0x0c, 0x09, 0x96, 0xa1, 0x02]);
    add(&[
        0x09, 0x97, 0x09, 0x98, 0x09, 0x99, 0x09, 0x9a, 0x09, 0x9b, 0x09, 0x9c,
    ]);
    add(&[
        0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x91, 0x02, 0xc0, 0xc0,
    ]);
    // Device Gain, output 13.
    add(&[0x09, 0x7d, 0xa1, 0x02, 0x85, 0x0d, 0x09, 0x7e]);
    add(&[
        0x15, 0x00, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x01, 0x91, 0x02, 0xc0,
    ]);
    // Create New Effect, feature 17: type, size of 10 bits and 6 of padding.
    add(&[0x09, 0xab, 0xa1, 0x02, 0x85, 0x11, 0x09, 0x25, 0xa1, 0x02]);
    add(&[
        0x09, 0x26, 0x09, 0x27, 0x09, 0x40, 0x15, 0x01, 0x25, 0x03, 0xb1, 0x00, 0xc0,
    ]);
    add(&[
        0x05, 0x01, 0x09, 0x3b, 0x15, 0x00, 0x26, 0xff, 0x01, 0x75, 0x0a, 0xb1, 0x02,
    ]);
    add(&[0x75, 0x06, 0xb1, 0x01, 0xc0, 0x05, 0x0f]);
    // Block Load, feature 18: block, success / full / error, memory left.
    add(&[0x09, 0x89, 0xa1, 0x02, 0x85, 0x12]);
    add(&[
        0x09, 0x22, 0x15, 0x01, 0x25, 0x28, 0x75, 0x08, 0x95, 0x01, 0xb1, 0x02,
    ]);
    add(&[0x09, 0x8b, 0xa1, 0x02, 0x09, 0x8c, 0x09, 0x8d, 0x09, 0x8e]);
    add(&[0x15, 0x01, 0x25, 0x03, 0xb1, 0x00, 0xc0]);
    add(&[
        0x09, 0xac, 0x15, 0x00, 0x27, 0xff, 0xff, 0x00, 0x00, 0x75, 0x10, 0xb1, 0x00, 0xc0,
    ]);
    add(&[0xc0]);
    d
}

/// A device that hands out `room` blocks and keeps what it was sent.
struct Fake {
    room: u8,
    given: u8,
    plugged: bool,
    sent: Vec<Vec<u8>>,
}

#[derive(Clone)]
struct FakePort(Arc<Mutex<Fake>>);

impl HidPort for FakePort {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, DeviceError> {
        std::thread::sleep(Duration::from_millis(1));
        if !self.0.lock().unwrap().plugged {
            return Err(DeviceError::Disconnected);
        }
        // Buttons 1 and 8; x at its greatest, y in the middle.
        let report = [0x01, 0x81, 0xff, 0x7f, 0x00, 0x00];
        buffer[..6].copy_from_slice(&report);
        Ok(6)
    }

    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.0.lock().unwrap().sent.push(report.to_vec());
        Ok(())
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.write(report)
    }

    fn get_feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        let mut fake = self.0.lock().unwrap();
        assert_eq!(report[0], 0x12);
        let status = if fake.given < fake.room { 1 } else { 2 };
        fake.given += u8::from(status == 1);
        report.copy_from_slice(&[0x12, fake.given, status, 0x00, 0x10]);
        Ok(5)
    }

    fn descriptor(&mut self) -> Result<Vec<u8>, DeviceError> {
        Ok(descriptor())
    }
}

fn fake(room: u8) -> (Arc<Mutex<Fake>>, Result<Threaded, DeviceError>) {
    let fake = Arc::new(Mutex::new(Fake {
        room,
        given: 0,
        plugged: true,
        sent: Vec::new(),
    }));
    let connector = || -> Connector {
        let port = FakePort(Arc::clone(&fake));
        Box::new(move || Ok(Box::new(port.clone())))
    };
    let device = open("fake", connector(), connector(), PidSettings::default());
    (fake, device)
}

fn push(x: f64, y: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, y, 0.0),
        ..Wrench::ZERO
    }
}

fn until(mut done: impl FnMut() -> bool) {
    let begin = std::time::Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(20), "never happened");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_device_is_set_up_report_by_report() {
    let (fake, device) = fake(8);
    drop(device.unwrap());
    let sent = fake.lock().unwrap().sent.clone();
    let effect = |block: u8, axis: u8| {
        let mut report = vec![
            0x01, block, 1, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0xff, 0xff, axis,
        ];
        report.extend([0; 8]);
        report
    };
    let expected = [
        vec![0x0c, 0x08],
        vec![0x0c, 0x01],
        vec![0x0d, 0xff],
        vec![0x11, 1, 0, 0],
        effect(1, 0b01),
        vec![0x11, 1, 0, 0],
        effect(2, 0b10),
    ];
    assert_eq!(sent[..7], expected);
    // Dropping it stops it.
    assert_eq!(sent.last(), Some(&vec![0x0c, 0x04]));
}

#[test]
fn forces_become_magnitudes_and_effects_start_once() {
    let (fake, device) = fake(8);
    let mut device = device.unwrap();
    let clear = || std::mem::take(&mut fake.lock().unwrap().sent);
    clear();
    crate::Device::send(&mut device, &push(2.5, -5.0)).unwrap();
    until(|| fake.lock().unwrap().sent.len() >= 4);
    assert_eq!(
        clear()[..4],
        [
            vec![0x05, 1, 0x88, 0x13],
            vec![0x0a, 1, 1, 0xff],
            vec![0x05, 2, 0xf0, 0xd8],
            vec![0x0a, 2, 1, 0xff],
        ]
    );
    crate::Device::stop_all(&mut device).unwrap();
    let stopped = clear();
    assert_eq!(stopped.last(), Some(&vec![0x0c, 0x04]));
    assert!(stopped.contains(&vec![0x05, 1, 0, 0]));
}

#[test]
fn the_record_and_the_input_follow_the_descriptor() {
    let (_, device) = fake(8);
    let mut device = device.unwrap();
    let spec = crate::Device::spec(&device).clone();
    assert_eq!((spec.input_dof, spec.output_dof), (3, 2));
    until(|| crate::Device::poll(&mut device, 0.0).is_ok());
    let state = crate::Device::poll(&mut device, 0.0).unwrap();
    assert_eq!(state.buttons, 0x81);
    assert!((state.pose.translation.x - 0.1).abs() < 1e-12);
    // Halfway between -32767 and 32767.
    assert!(state.pose.translation.y.abs() < 1e-12);
    crate::conformance::check(&mut device).unwrap();
}

#[test]
fn a_full_pool_is_told() {
    let (_, device) = fake(1);
    let error = device.err().unwrap().to_string();
    assert!(error.contains("full effect pool"), "{error}");
}

#[test]
fn a_joystick_without_motors_is_refused() {
    let stick = descriptor()[..40]
        .iter()
        .copied()
        .chain([0xc0])
        .collect::<Vec<u8>>();
    let error = PidLayout::parse("stick", &stick).unwrap_err().to_string();
    assert!(
        error.contains("stick") && error.contains("set effect"),
        "{error}"
    );
    assert!(PidLayout::parse("noise", &[0xff; 7]).is_err());
}

#[test]
fn a_device_comes_back_and_is_set_up_again() {
    let (fake, device) = fake(200);
    let mut device = device.unwrap();
    fake.lock().unwrap().plugged = false;
    until(|| crate::Device::poll(&mut device, 0.0) == Err(DeviceError::Disconnected));
    fake.lock().unwrap().plugged = true;
    until(|| crate::Device::poll(&mut device, 0.0).is_ok());
}
