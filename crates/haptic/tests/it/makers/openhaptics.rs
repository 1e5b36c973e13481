//! libHD.

use fft_correlate::Wrench;
use glam::{DMat3, DQuat, DVec3};
use haptic::device::info::Access;
use haptic::device::openhaptics::{PhantomOptions, find, open};
use haptic::{Device, DeviceError};

use super::promises::{Rig, keeps_all, push, pushing, soon_without_force, until};
use super::stub::Stub;

struct Touch(Stub);

impl Touch {
    fn new() -> Self {
        Self(Stub::build("hd.c", &[]))
    }

    fn options(&self) -> PhantomOptions {
        PhantomOptions {
            name: None,
            library: Some(self.0.path()),
        }
    }
}

impl Rig for Touch {
    fn open(&self) -> Box<dyn Device> {
        open(self.options()).unwrap()
    }

    fn force(&self) -> DVec3 {
        let [x, y, z] = self.0.all("stub_motor");
        DVec3::new(x, -z, y)
    }

    fn put(&self, at: DVec3) {
        let [x, y, z] = (DVec3::new(at.x, at.z, -at.y) * 1e3).to_array();
        let mut transform = self.0.all::<16>("stub_transform");
        transform[12..15].copy_from_slice(&[x, y, z]);
        self.0.set("stub_transform", &transform);
    }

    fn plug(&self, plugged: bool) {
        // HD_COMM_ERROR, and no device to be opened.
        let error = if plugged { 0.0 } else { f64::from(0x0302) };
        self.0.set("stub_init_error", &[error]);
        self.0.set("stub_error", &[error]);
        self.0.set("stub_stands_still", &[0.0]);
    }
}

#[test]
fn a_touch_keeps_every_promise() {
    keeps_all(&Touch::new());
}

#[test]
fn poses_velocities_and_buttons_come_in_our_frame_and_units() {
    let touch = Touch::new();
    // A turn about the stub's y, which points up: about our z.
    let turn = DMat3::from_rotation_y(0.4);
    let mut columns = [0.0; 16];
    for c in 0..3 {
        columns[4 * c..4 * c + 3].copy_from_slice(&turn.col(c).to_array());
    }
    columns[12..].copy_from_slice(&[10.0, 20.0, -30.0, 1.0]);
    touch.0.set("stub_transform", &columns);
    touch.0.set("stub_velocity", &[100.0, -200.0, 50.0]);
    touch.0.set("stub_angular_velocity", &[0.1, 0.2, 0.3]);
    touch.0.set("stub_buttons", &[2.0]);
    let mut device = touch.open();
    until("input", || device.poll(0.0).is_ok());
    let state = device.poll(0.0).unwrap();
    let at = DVec3::new(0.010, 0.030, 0.020);
    assert!((state.pose.translation - at).length() < 1e-15);
    let expected = DQuat::from_rotation_z(0.4);
    assert!(state.pose.rotation.angle_between(expected) < 1e-7);
    assert!((state.twist.linear - DVec3::new(0.1, -0.05, -0.2)).length() < 1e-15);
    assert!((state.twist.angular - DVec3::new(0.1, -0.3, 0.2)).length() < 1e-15);
    assert_eq!(state.buttons, 0b10);
}

#[test]
fn forces_and_torques_go_out_in_its_frame_and_units() {
    let touch = Touch::new();
    touch.0.set("stub_output_dof", &[6.0]);
    let mut device = touch.open();
    let spec = device.spec().clone();
    assert_eq!((spec.input_dof, spec.output_dof), (6, 6));
    assert_eq!(spec.name, "Stub Touch");
    assert_eq!((spec.max_force, spec.max_torque), (3.3, 0.18));
    assert_eq!(
        (spec.max_stiffness, spec.max_rotational_stiffness),
        (500.0, 0.8)
    );
    assert_eq!((spec.workspace, spec.nominal_rate), (0.42, 1000.0));
    let wrench = Wrench {
        torque: DVec3::new(0.01, -0.02, 0.03),
        force: DVec3::new(1.0, 2.0, -0.5),
    };
    until("the wrench", || {
        device.send(&wrench).unwrap();
        let motor = touch.0.all::<6>("stub_motor");
        let expected = [1.0, -0.5, -2.0, 10.0, 30.0, 20.0];
        motor
            .iter()
            .zip(expected)
            .all(|(m, e)| (m - e).abs() < 1e-12)
    });
    drop(device);
    // A device of three axes is sent no torque.
    touch.0.set("stub_output_dof", &[3.0]);
    let mut device = touch.open();
    assert_eq!(
        (device.spec().output_dof, device.spec().max_torque),
        (3, 0.0)
    );
    until("the force", || {
        device.send(&wrench).unwrap();
        touch.force().x > 0.9
    });
}

#[test]
fn a_force_error_lets_go_and_rises_anew() {
    let touch = Touch::new();
    let mut device = touch.open();
    pushing(&touch, device.as_mut(), DVec3::X);
    touch.0.set("stub_error", &[f64::from(0x0201)]);
    until("the fault", || device.last_fault().is_some());
    let told = device.last_fault().unwrap().to_string();
    assert!(
        told.contains("HD_EXCEEDED_MAX_FORCE (0x0201, -7)"),
        "{told}"
    );
    assert!(told.contains("as the stub was told"), "{told}");
    assert!(device.poll(0.0).is_ok(), "the device is still there");
    touch.0.set("stub_error", &[0.0]);
    let mut first = 0.0;
    until("the force", || {
        device.send(&push(1.0, 0.0, 0.0)).unwrap();
        first = touch.force().x;
        first > 0.0
    });
    assert!(first < 0.5, "{first}");
}

#[test]
fn a_scheduler_that_stands_still_leaves_no_force() {
    let touch = Touch::new();
    soon_without_force(&touch, "a scheduler that stands still", |device| {
        touch.0.set("stub_stands_still", &[1.0]);
        until("no force", || {
            let _ = device.as_mut().unwrap().send(&push(0.5, -1.0, 0.75));
            touch.force() == DVec3::ZERO
        });
    });
    // Called again in time, it is not gone, and its force rises anew.
    let mut device = touch.open();
    pushing(&touch, device.as_mut(), DVec3::X);
    touch.0.set("stub_stands_still", &[1.0]);
    until("no force", || touch.force() == DVec3::ZERO);
    touch.0.set("stub_stands_still", &[0.0]);
    let mut first = 0.0;
    until("its rising again", || {
        let _ = device.send(&push(1.0, 0.0, 0.0));
        first = touch.force().x;
        first > 0.0
    });
    assert!(first < 0.5, "{first}");
}

#[test]
fn a_scheduler_that_has_died_is_noticed() {
    let touch = Touch::new();
    let mut device = touch.open();
    pushing(&touch, device.as_mut(), DVec3::X);
    touch.0.set("stub_stands_still", &[1.0]);
    until("its being gone", || {
        device.poll(0.0) == Err(DeviceError::Disconnected)
    });
    assert_eq!(touch.force(), DVec3::ZERO);
    touch.0.set("stub_stands_still", &[0.0]);
    until("its coming back", || device.poll(0.0).is_ok());
}

#[test]
fn a_device_that_is_not_calibrated_is_listed_and_says_what_to_do() {
    let touch = Touch::new();
    for (style, words) in [
        (1.0, "reset posture"),
        (2.0, "whole reach"),
        (4.0, "inkwell"),
    ] {
        touch.0.set("stub_calibration", &[f64::from(0x5002)]);
        touch.0.set("stub_style", &[style]);
        let info = find(&touch.options()).unwrap();
        assert_eq!(
            (info.path.as_str(), info.serial.as_str()),
            ("openhaptics:Default Device", "SN1234")
        );
        let Access::Failed(reason) = &info.access else {
            panic!("{:?}", info.access);
        };
        assert!(
            reason.contains("not calibrated") && reason.contains(words),
            "{reason}"
        );
        let error = open(touch.options()).err().unwrap();
        assert!(matches!(error, DeviceError::NotReady { .. }), "{error}");
    }
    // A stylus in the inkwell: the library waits to be told.
    touch.0.set("stub_calibration", &[f64::from(0x5001)]);
    assert_eq!(find(&touch.options()).unwrap().access, Access::Ready);
    assert_eq!(touch.0.get("stub_calibration", 0), f64::from(0x5000));
    // Lost while it is held: nothing is known of the handle, and nothing pushes.
    let mut device = touch.open();
    pushing(&touch, device.as_mut(), DVec3::X);
    touch.0.set("stub_calibration", &[f64::from(0x5002)]);
    until("no input", || {
        device.send(&push(1.0, 0.0, 0.0)).unwrap();
        device.poll(0.0) == Err(DeviceError::NoInput) && touch.force() == DVec3::ZERO
    });
}

#[test]
fn what_is_missing_is_said_in_words_that_help() {
    let touch = Touch::new();
    touch.0.set("stub_init_error", &[f64::from(0x0302)]);
    let told = find(&touch.options()).unwrap_err().to_string();
    assert!(
        told.contains("HD_COMM_ERROR") && told.contains("udev"),
        "{told}"
    );
    touch.0.set("stub_init_error", &[0.0]);
    let named = PhantomOptions {
        name: Some("Left".into()),
        ..touch.options()
    };
    let info = find(&named).unwrap();
    assert_eq!(
        (info.path.as_str(), info.name.as_str()),
        ("openhaptics:Left", "Stub Left")
    );

    let nowhere = PhantomOptions {
        library: Some("/nowhere/libHD.so".into()),
        ..PhantomOptions::default()
    };
    let told = find(&nowhere).unwrap_err().to_string();
    for word in [
        "OpenHaptics is not installed",
        "/nowhere/libHD.so",
        "PEGFIT_LIBHD",
        "Touch device driver",
    ] {
        assert!(told.contains(word), "{told}");
    }
    let old = Stub::build("hd.c", &["-DWITHOUT_UNSCHEDULE"]);
    let options = PhantomOptions {
        library: Some(old.path()),
        ..PhantomOptions::default()
    };
    for told in [find(&options).unwrap_err(), open(options).err().unwrap()] {
        let told = told.to_string();
        assert!(
            told.contains("no function hdUnschedule") && told.contains("3.0"),
            "{told}"
        );
    }
}

#[test]
fn a_name_that_a_terminal_would_obey_is_escaped() {
    let evil = Stub::build("hd.c", &[r#"-DSTUB_VENDOR="3D\033]0;mine\a""#]);
    let options = PhantomOptions {
        name: None,
        library: Some(evil.path()),
    };
    assert_eq!(find(&options).unwrap().name, r"3D\u001b]0;mine\u0007 Touch");
}
