//! Haply's service.

mod impostor;
mod service;

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use haptic::device::haply::{CENTRE, InverseOptions, find, open};
use haptic::device::info::Access;
use haptic::{Device, DeviceError};

use super::promises::{Rig, keeps_all, push, pushing, until};
use service::{Manner, Service};

impl Service {
    fn options(&self) -> InverseOptions {
        InverseOptions {
            address: self.address(),
            id: None,
        }
    }
}

impl Rig for Service {
    fn open(&self) -> Box<dyn Device> {
        open(self.options()).unwrap()
    }

    fn force(&self) -> DVec3 {
        self.with(|s| s.force)
    }

    fn put(&self, at: DVec3) {
        self.with(|s| s.at = at + CENTRE);
    }

    fn plug(&self, plugged: bool) {
        // Not the cable but the service itself: the harder case.
        self.with(|s| {
            s.manner = if plugged {
                Manner::Answers
            } else {
                Manner::Gone
            }
        });
    }
}

#[test]
fn an_inverse3_keeps_every_promise() {
    keeps_all(&Service::start());
}

#[test]
fn an_inverse3_of_a_service_before_3_5_keeps_every_promise() {
    let service = Service::start();
    service.with(|s| s.since_3_5 = false);
    keeps_all(&service);
}

#[test]
fn poses_rotations_and_buttons_come_in_our_frame() {
    let service = Service::start();
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5);
    service.with(|s| {
        s.at = CENTRE + DVec3::new(0.01, 0.02, -0.03);
        s.speed = DVec3::new(0.1, -0.2, 0.3);
        s.grip = Some(turn);
        s.buttons = [true, false, true];
    });
    let mut device = service.open();
    let spec = device.spec().clone();
    assert_eq!(
        (spec.input_dof, spec.output_dof, spec.max_force),
        (6, 3, 10.0)
    );
    assert_eq!(spec.name, "Haply Inverse3 with VerseGrip");
    until("input", || device.poll(0.0).is_ok());
    let state = device.poll(0.0).unwrap();
    assert!((state.pose.translation - DVec3::new(0.01, 0.02, -0.03)).length() < 1e-15);
    assert!(state.pose.rotation.angle_between(turn) < 1e-7);
    assert_eq!(state.twist.linear, DVec3::new(0.1, -0.2, 0.3));
    assert_eq!(state.buttons, 0b101);
    // A grip that falls asleep: nobody knows how the part is turned.
    service.with(|s| s.grip = None);
    until("no input", || device.poll(0.0) == Err(DeviceError::NoInput));
    drop(device);
    // Opened without one, it has no rotation.
    let mut device = service.open();
    assert_eq!(
        (device.spec().input_dof, device.spec().name.as_str()),
        (3, "Haply Inverse3")
    );
    until("input", || device.poll(0.0).is_ok());
    assert_eq!(device.poll(0.0).unwrap().pose.rotation, DQuat::IDENTITY);
}

/// Pushes, lets the service behave like that, and looks that the device is gone and says why.
fn ends(manner: Manner, words: &str) {
    let service = Service::start();
    let mut device = service.open();
    pushing(&service, device.as_mut(), DVec3::X);
    service.with(|s| s.manner = manner);
    until("its being gone", || {
        let _ = device.send(&push(1.0, 0.0, 0.0));
        device.poll(0.0) == Err(DeviceError::Disconnected)
    });
    let told = device.last_fault().unwrap().to_string();
    assert!(told.contains(words), "{manner:?}: {told}");
    until("no force", || service.with(|s| s.force) == DVec3::ZERO);
    service.with(|s| s.manner = Manner::Answers);
    until("its coming back", || device.poll(0.0).is_ok());
}

#[test]
fn garbage_a_lost_device_and_a_service_that_goes_end_the_force() {
    ends(Manner::Garbage, "JSON");
    ends(Manner::Binary, "a binary message");
    ends(Manner::LosesDevice, "device");
    ends(Manner::Gone, "has gone");
    ends(Manner::Silent, "has not answered for 100ms");
    ends(Manner::EmptyPieces, "has not answered for 100ms");
}

#[test]
fn a_service_that_stops_answering_is_told_to_let_go_soon() {
    let mut took = Vec::new();
    for _ in 0..8 {
        let service = Service::start();
        let mut device = service.open();
        pushing(&service, device.as_mut(), DVec3::X);
        service.with(|s| s.manner = Manner::Silent);
        let begin = Instant::now();
        until("no force", || {
            let _ = device.send(&push(1.0, 0.0, 0.0));
            service.with(|s| s.force) == DVec3::ZERO
        });
        took.push(begin.elapsed());
        // A busy machine stops a thread for longer than that now and then.
        if took.last().is_some_and(|t| *t < Duration::from_millis(20)) {
            return;
        }
    }
    panic!("{took:?}");
}

#[test]
fn what_is_missing_is_said_in_words_that_help() {
    let service = Service::start();
    let failed = |words: &str| {
        let info = find(&service.options()).unwrap().remove(0);
        assert_eq!(info.path, "haply:049D");
        let Access::Failed(reason) = &info.access else {
            panic!("{:?}", info.access);
        };
        assert!(reason.contains(words), "{reason}");
        assert!(open(service.options()).is_err());
    };
    service.with(|s| s.basis = "XZY");
    failed("basis XYZ");
    service.with(|s| s.in_use = true);
    failed("another program");
    service.with(|s| s.calibrated = false);
    failed("not calibrated");
    service.with(|s| s.powered = false);
    failed("no power");
    let other = InverseOptions {
        id: Some("FFFF".into()),
        ..service.options()
    };
    let told = open(other).err().unwrap().to_string();
    assert!(told.contains("sees no device FFFF"), "{told}");
    service.with(|s| s.manner = Manner::LosesDevice);
    let told = find(&service.options()).unwrap_err().to_string();
    assert!(told.contains("sees no device"), "{told}");
    service.with(|s| s.manner = Manner::Garbage);
    let told = find(&service.options()).unwrap_err().to_string();
    assert!(told.contains("version 3.1 or later"), "{told}");
    let address = service.address();
    drop(service);
    let gone = InverseOptions { address, id: None };
    let told = find(&gone).unwrap_err().to_string();
    for word in [
        "is not installed",
        "nothing answers at 127.0.0.1",
        "systemctl",
        "PEGFIT_HAPLY",
    ] {
        assert!(told.contains(word), "{told}");
    }
}
