//! libdhd.

use fft_correlate::Wrench;
use glam::{DMat3, DQuat, DVec3};
use haptic::device::force_dimension::{DhdOptions, find, open};
use haptic::device::info::Access;
use haptic::{Device, DeviceError};

use super::promises::{Rig, keeps_all, until};
use super::stub::Stub;

struct Sigma(Stub);

impl Sigma {
    fn new() -> Self {
        Self(Stub::build("dhd.c", &[]))
    }

    fn options(&self) -> DhdOptions {
        DhdOptions {
            library: Some(self.0.path()),
            ..DhdOptions::default()
        }
    }
}

impl Rig for Sigma {
    fn open(&self) -> Box<dyn Device> {
        open(self.options()).unwrap()
    }

    fn force(&self) -> DVec3 {
        let [x, y, z] = self.0.all("stub_motor");
        DVec3::new(y, -x, z)
    }

    fn put(&self, at: DVec3) {
        self.0.set("stub_position", &[-at.y, at.x, at.z]);
    }

    fn plug(&self, plugged: bool) {
        // DHD_ERROR_COM, in every call.
        self.0.set("stub_error", &[if plugged { 0.0 } else { 2.0 }]);
    }
}

#[test]
fn a_sigma_keeps_every_promise() {
    keeps_all(&Sigma::new());
}

#[test]
fn poses_velocities_and_buttons_come_in_our_frame() {
    let sigma = Sigma::new();
    // About the stub's x, which points to the user: back about our y.
    let rows = DMat3::from_rotation_x(0.4).transpose().to_cols_array();
    sigma.0.set("stub_frame", &rows);
    sigma.0.set("stub_position", &[0.01, 0.02, 0.03]);
    sigma.0.set("stub_velocity", &[0.1, 0.2, 0.3]);
    sigma.0.set("stub_angular_velocity", &[1.0, 2.0, 3.0]);
    sigma.0.set("stub_buttons", &[5.0]);
    let mut device = sigma.open();
    until("input", || device.poll(0.0).is_ok());
    let state = device.poll(0.0).unwrap();
    assert!((state.pose.translation - DVec3::new(0.02, -0.01, 0.03)).length() < 1e-15);
    let expected = DQuat::from_rotation_y(-0.4);
    assert!(state.pose.rotation.angle_between(expected) < 1e-7);
    assert!((state.twist.linear - DVec3::new(0.2, -0.1, 0.3)).length() < 1e-15);
    assert!((state.twist.angular - DVec3::new(2.0, -1.0, 3.0)).length() < 1e-15);
    assert_eq!(state.buttons, 5);
}

#[test]
fn wrenches_go_out_in_its_frame_and_torques_where_it_has_motors_for_them() {
    let sigma = Sigma::new();
    let wrench = Wrench {
        torque: DVec3::new(0.1, 0.2, -0.3),
        force: DVec3::new(1.0, 2.0, 3.0),
    };
    let reached = |device: &mut dyn Device, expected: [f64; 6]| {
        until("the wrench", || {
            device.send(&wrench).unwrap();
            let motor = sigma.0.all::<6>("stub_motor");
            motor
                .iter()
                .zip(expected)
                .all(|(m, e)| (m - e).abs() < 1e-12)
        });
    };
    let mut device = sigma.open();
    let spec = device.spec().clone();
    assert_eq!((spec.input_dof, spec.output_dof), (6, 6));
    assert_eq!(
        (spec.name.as_str(), spec.max_force, spec.max_torque),
        ("stub.7", 12.0, 0.2)
    );
    reached(device.as_mut(), [-2.0, 1.0, 3.0, -0.2, 0.1, -0.3]);
    assert_eq!(sigma.0.get("stub_gravity", 0), 1.0);
    assert_eq!(sigma.0.get("stub_gripper", 0), 0.0);
    drop(device);
    // An omega.6 senses rotations, a Falcon does not; neither shows torques.
    for (system_type, wrist, dof, force) in [(34.0, 1.0, 6, 12.0), (60.0, 0.0, 3, 8.0)] {
        sigma.0.set("stub_type", &[system_type]);
        sigma.0.set("stub_wrist", &[wrist]);
        sigma.0.set("stub_active", &[0.0]);
        sigma.0.set("stub_frame", &[wrist; 9]);
        let mut device = sigma.open();
        let spec = device.spec().clone();
        assert_eq!((spec.input_dof, spec.output_dof), (dof, 3));
        assert_eq!((spec.max_force, spec.max_torque), (force, 0.0));
        reached(device.as_mut(), [-2.0, 1.0, 3.0, 0.0, 0.0, 0.0]);
        let unturned = device.poll(0.0).unwrap().pose.rotation == DQuat::IDENTITY;
        assert!(unturned || dof == 6);
    }
}

#[test]
fn every_device_is_listed_and_opened_by_place_and_serial_number() {
    let sigma = Sigma::new();
    sigma.0.set("stub_count", &[3.0]);
    let found = find(&sigma.options()).unwrap();
    let listed: Vec<_> = found
        .iter()
        .map(|i| (i.path.as_str(), i.serial.as_str()))
        .collect();
    let expected = [
        "force-dimension:0",
        "force-dimension:1",
        "force-dimension:2",
    ];
    assert_eq!(
        listed,
        expected
            .into_iter()
            .zip(["4000", "4001", "4002"])
            .collect::<Vec<_>>()
    );
    assert!(
        found
            .iter()
            .all(|i| i.access == Access::Ready && i.is_called(&i.serial))
    );
    let second = |serial| DhdOptions {
        index: 1,
        serial: Some(serial),
        ..sigma.options()
    };
    drop(open(second(4001)).unwrap());
    let other = open(second(4000)).err().unwrap().to_string();
    assert!(
        other.contains("serial number 4000") && other.contains("4001"),
        "{other}"
    );
}

#[test]
fn what_is_missing_is_said_in_words_that_help() {
    let sigma = Sigma::new();
    let failed = |words: &str| {
        let info = find(&sigma.options()).unwrap().remove(0);
        let Access::Failed(reason) = &info.access else {
            panic!("{:?}", info.access);
        };
        assert!(reason.contains(words), "{reason}");
        let error = open(sigma.options()).err().unwrap();
        assert!(matches!(error, DeviceError::NotReady { .. }), "{error}");
    };
    sigma.0.set("stub_reset", &[0.0]);
    failed("not calibrated");
    sigma.0.set("stub_power", &[0.0]);
    failed("no power");
    sigma.0.set("stub_open_error", &[20.0]);
    failed("another program");
    sigma.0.set("stub_count", &[0.0]);
    let told = find(&sigma.options()).unwrap_err().to_string();
    assert!(
        told.contains("sees no device") && told.contains("udev"),
        "{told}"
    );
    sigma.0.set("stub_version", &[3.0, 2.0]);
    let told = find(&sigma.options()).unwrap_err().to_string();
    assert!(told.contains("version 3.2.6"), "{told}");

    let nowhere = DhdOptions {
        library: Some("/nowhere/libdhd.so".into()),
        ..DhdOptions::default()
    };
    let told = find(&nowhere).unwrap_err().to_string();
    for word in [
        "Force Dimension SDK is not installed",
        "/nowhere/libdhd.so",
        "PEGFIT_LIBDHD",
    ] {
        assert!(told.contains(word), "{told}");
    }
    let old = Stub::build("dhd.c", &["-DWITHOUT_WRENCH"]);
    let options = DhdOptions {
        library: Some(old.path()),
        ..DhdOptions::default()
    };
    let told = open(options).err().unwrap().to_string();
    assert!(
        told.contains("no function dhdSetForceAndTorqueAndGripperForce"),
        "{told}"
    );
}

#[test]
fn a_name_that_a_terminal_would_obey_is_escaped() {
    let evil = Stub::build("dhd.c", &[r#"-DSTUB_NAME="Delta\033[2J\a""#]);
    let options = DhdOptions {
        library: Some(evil.path()),
        ..DhdOptions::default()
    };
    let info = find(&options).unwrap().remove(0);
    assert_eq!(info.name, r"Delta\u001b[2J\u0007");
    assert_eq!(open(options).unwrap().spec().name, info.name);
}
