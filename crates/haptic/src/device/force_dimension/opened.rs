//! A device of libdhd: opened, described, pushed, closed.

use std::ffi::{c_char, c_int};
use std::sync::Arc;

use fft_correlate::Wrench;
use glam::{DMat3, DQuat, DVec3};

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::force_dimension::api::{Api, Id, ON, status, words};
use crate::device::force_dimension::model::model;
use crate::device::frame::Axes;
use crate::device::servo::turn::{Handle, Turn};

/// Rotational stiffness \[N·m/rad\]: none is stated for any model.
const ROTATIONAL_STIFFNESS: f64 = 1.0;

/// Exchanges per second for which stiffnesses are stated.
const RATE: f64 = 1000.0;

/// An open device. Dropping it takes its force away and closes it.
pub(super) struct Opened {
    api: Arc<Api>,
    id: Id,
    name: String,
    wrist: bool,
    torque: bool,
}

impl Opened {
    /// Opens the device at this place of the library's list, without force.
    pub(super) fn new(api: Arc<Api>, index: u8) -> Result<Self, DeviceError> {
        let name = called(index);
        let place = c_char::try_from(index).map_err(|_| DeviceError::Unsuitable {
            name: name.clone(),
            expected: "a place below 128".into(),
            found: index.to_string(),
        })?;
        // SAFETY: any place will do; one without a device is an error.
        let id = unsafe { (api.open_id)(place) };
        api.done(id, &name)?;
        let id = Id::try_from(id).map_err(|_| DeviceError::System {
            name: name.clone(),
            reason: format!("the driver gave it the number {id}, which is none of its own"),
        })?;
        // SAFETY: an open device.
        let (system_name, wrist, torque) = unsafe {
            (
                words((api.system_name)(id)),
                (api.has_wrist)(id) != 0,
                (api.has_active_wrist)(id) != 0,
            )
        };
        let name = match system_name.as_str() {
            "" => name,
            known => known.to_owned(),
        };
        Ok(Self {
            api,
            id,
            name,
            wrist,
            torque,
        })
    }

    /// What it can do.
    pub(super) fn spec(&self) -> DeviceSpec {
        // SAFETY: an open device.
        let system_type = unsafe { (self.api.system_type)(self.id) };
        spec(&self.name, system_type, self.wrist, self.torque)
    }

    /// Its serial number, `None` if it has none.
    pub(super) fn serial(&self) -> Option<u16> {
        let mut serial = 0;
        // SAFETY: an open device, and a number to fill.
        let code = unsafe { (self.api.serial_number)(&raw mut serial, self.id) };
        (code >= 0).then_some(serial)
    }

    /// Whether it is switched on and calibrated.
    pub(super) fn ready(&self) -> Result<(), DeviceError> {
        let mut fields = [0; status::ROOM];
        // SAFETY: an open device; there is room for more entries than any version has.
        let code = unsafe { (self.api.status)(fields.as_mut_ptr(), self.id) };
        self.api.done(code, &self.name)?;
        let missing = |reason: &str| DeviceError::NotReady {
            name: self.name.clone(),
            reason: reason.into(),
        };
        if fields[status::POWER] == 0 {
            return Err(missing("it has no power: switch it on"));
        }
        if fields[status::RESET] == 0 {
            return Err(missing(
                "it is not calibrated: put its calibration pole into the pit until the light is \
                 steady, or run the SDK's HapticInit (a Falcon: pull its grip out and push it in)",
            ));
        }
        Ok(())
    }

    /// Lets the motors push: its own weight first, and nothing else yet.
    pub(super) fn enable(&self) -> Result<(), DeviceError> {
        let (api, id) = (&self.api, self.id);
        // SAFETY: an open device.
        unsafe {
            api.done((api.set_gravity_compensation)(ON, id), &self.name)?;
            api.done((api.enable_force)(1, id), &self.name)?;
        }
        self.push(&Wrench::ZERO)
    }

    /// Pushes with `wrench`, reads the handle.
    pub(super) fn exchange(&self, wrench: &Wrench) -> Result<Turn, DeviceError> {
        self.push(wrench)?;
        let (api, id) = (&self.api, self.id);
        let (mut at, mut rows) = (DVec3::ZERO, [[0.0; 3]; 3]);
        // SAFETY: an open device, three numbers and three rows of three to fill.
        let code = unsafe {
            (api.pose)(
                &raw mut at.x,
                &raw mut at.y,
                &raw mut at.z,
                &raw mut rows,
                id,
            )
        };
        api.done(code, &self.name)?;
        let linear = api.vector(api.linear_velocity, id, &self.name)?;
        let (rotation, angular) = match self.wrist {
            true => (
                DQuat::from_mat3(&DMat3::from_cols_array_2d(&rows).transpose()),
                api.vector(api.angular_velocity, id, &self.name)?,
            ),
            false => (DQuat::IDENTITY, DVec3::ZERO),
        };
        let handle = Handle {
            pose: Axes::X_TO_USER.pose(rotation, at),
            twist: Axes::X_TO_USER.twist(angular, linear),
            // SAFETY: an open device.
            buttons: unsafe { (api.button_mask)(id) },
        };
        Ok(Turn {
            handle: Some(handle),
            refused: None,
        })
    }

    fn push(&self, wrench: &Wrench) -> Result<(), DeviceError> {
        let force = Axes::X_TO_USER.to_maker(wrench.force);
        let torque = match self.torque {
            true => Axes::X_TO_USER.to_maker(wrench.torque),
            false => DVec3::ZERO,
        };
        // The gripper, where there is one, is left to the hand.
        // SAFETY: an open device.
        let code = unsafe {
            (self.api.set_wrench)(
                force.x, force.y, force.z, torque.x, torque.y, torque.z, 0.0, self.id,
            )
        };
        self.api.done(code, &self.name)
    }
}

/// What a device can do that cannot be opened: as little as any.
pub(super) fn unknown(index: u8) -> DeviceSpec {
    spec(&called(index), 0, false, false)
}

fn spec(name: &str, system_type: c_int, wrist: bool, torque: bool) -> DeviceSpec {
    let model = model(system_type);
    DeviceSpec {
        name: name.to_owned(),
        input_dof: if wrist { 6 } else { 3 },
        output_dof: if torque { 6 } else { 3 },
        rate_controlled: false,
        max_force: model.force,
        max_torque: if torque { model.torque } else { 0.0 },
        max_stiffness: model.stiffness,
        max_rotational_stiffness: ROTATIONAL_STIFFNESS,
        workspace: model.workspace,
        nominal_rate: RATE,
    }
}

/// A device before it has said its name.
fn called(index: u8) -> String {
    format!("Force Dimension device {index}")
}

impl Drop for Opened {
    fn drop(&mut self) {
        // A device that is gone takes nothing any more.
        let _ = self.push(&Wrench::ZERO);
        // SAFETY: an open device, with which nothing is called any more.
        unsafe {
            (self.api.stop)(self.id);
            (self.api.close)(self.id);
        }
    }
}
