//! A device of libdhd: options, description, exchange.

use std::ffi::{c_char, c_int};
use std::path::PathBuf;
use std::sync::Arc;

use fft_correlate::Wrench;
use glam::{DMat3, DQuat, DVec3};

use crate::device::contract::{Device, DeviceError, DeviceSpec};
use crate::device::driver::Axes;
use crate::device::force_dimension::api::{Api, DRIVER, Id, ON, driver_text, status};
use crate::device::info::{DeviceInfo, DeviceKind};
use crate::device::threaded::{Exchange, Motion, OpenDevice, Reading, ThreadedDevice};

/// Which device, and by which library.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DhdOptions {
    /// Place in the library's list, from 0; it lists devices that other programs hold too.
    pub index: u8,
    /// Serial number that the device there must have; `None` takes any.
    pub serial: Option<u16>,
    /// File of the library; `None` for the installed one.
    pub library: Option<PathBuf>,
}

impl DhdOptions {
    /// The first device, by the library that `PEGFIT_LIBDHD` names, else the installed one.
    pub fn from_env() -> Self {
        Self {
            library: DRIVER.file_in_env(),
            ..Self::default()
        }
    }
}

/// Numbers of a family of devices: of delta, omega and sigma no more than CHAI3D allows them; of
/// the others, and all sizes, cautious guesses.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Model {
    /// Greatest force, N.
    force: f64,
    /// Greatest torque, N·m, where the wrist has motors.
    torque: f64,
    /// Stiffest wall at a thousand exchanges per second, N/m.
    stiffness: f64,
    /// Widest side of the workspace, m.
    workspace: f64,
}

/// delta.x.
const DELTA: Model = Model {
    force: 20.0,
    torque: 0.2,
    stiffness: 5000.0,
    workspace: 0.40,
};

/// omega.x.
const OMEGA: Model = Model {
    force: 12.0,
    torque: 0.0,
    stiffness: 5000.0,
    workspace: 0.16,
};

/// sigma.x, and lambda.x, of which nothing is known here but its size.
const SIGMA: Model = Model {
    force: 12.0,
    torque: 0.2,
    stiffness: 4000.0,
    workspace: 0.24,
};

/// Novint Falcon.
const FALCON: Model = Model {
    force: 8.0,
    torque: 0.0,
    stiffness: 2000.0,
    workspace: 0.11,
};

/// Anything else that speaks the protocol: the least of the others.
const OTHER: Model = Model {
    force: 8.0,
    torque: 0.1,
    stiffness: 2000.0,
    workspace: 0.40,
};

/// The numbers of the library's type of a device.
fn model(system_type: c_int) -> Model {
    match system_type {
        31 | 61..=64 => DELTA,
        32..=37 => OMEGA,
        104..=109 | 203 | 206 => SIGMA,
        60 => FALCON,
        _ => OTHER,
    }
}

/// Rotational stiffness \[N·m/rad\]: none is stated for any model.
const ROTATIONAL_STIFFNESS: f64 = 1.0;

/// Exchanges per second for which stiffnesses are stated.
const RATE: f64 = 1000.0;

/// An open device. Dropping it takes its force away and closes it.
struct DhdDevice {
    api: Arc<Api>,
    id: Id,
    name: String,
    wrist: bool,
    torque: bool,
}

impl DhdDevice {
    /// Opens the device at this place of the library's list, without force.
    fn new(api: Arc<Api>, index: u8) -> Result<Self, DeviceError> {
        let name = default_name(index);
        let place = c_char::try_from(index).map_err(|_| DeviceError::Unsuitable {
            name: name.clone(),
            expected: "a place below 128".into(),
            found: index.to_string(),
        })?;
        // SAFETY: any place will do; one without a device is an error.
        let id = unsafe { (api.open_id)(place) };
        api.check(id, &name)?;
        let id = Id::try_from(id).map_err(|_| DeviceError::System {
            name: name.clone(),
            reason: format!("the driver gave it the number {id}, which is none of its own"),
        })?;
        // SAFETY: an open device.
        let (system_name, wrist, torque) = unsafe {
            (
                driver_text((api.system_name)(id)),
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
    fn spec(&self) -> DeviceSpec {
        // SAFETY: an open device.
        let system_type = unsafe { (self.api.system_type)(self.id) };
        spec(&self.name, system_type, self.wrist, self.torque)
    }

    /// Its serial number, `None` if it has none.
    fn serial(&self) -> Option<u16> {
        let mut serial = 0;
        // SAFETY: an open device, and a number to fill.
        let code = unsafe { (self.api.serial_number)(&raw mut serial, self.id) };
        (code >= 0).then_some(serial)
    }

    /// Whether it is switched on and calibrated.
    fn check_ready(&self) -> Result<(), DeviceError> {
        let mut fields = [0; status::ROOM];
        // SAFETY: an open device; there is room for more entries than any version has.
        let code = unsafe { (self.api.status)(fields.as_mut_ptr(), self.id) };
        self.api.check(code, &self.name)?;
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
    fn enable(&self) -> Result<(), DeviceError> {
        let (api, id) = (&self.api, self.id);
        // SAFETY: an open device.
        unsafe {
            api.check((api.set_gravity_compensation)(ON, id), &self.name)?;
            api.check((api.enable_force)(1, id), &self.name)?;
        }
        self.push(&Wrench::ZERO)
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
        self.api.check(code, &self.name)
    }
}

impl OpenDevice for DhdDevice {
    fn exchange(&mut self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
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
        api.check(code, &self.name)?;
        let linear = api.vector(api.linear_velocity, id, &self.name)?;
        let (rotation, angular) = match self.wrist {
            true => (
                DQuat::from_mat3(&DMat3::from_cols_array_2d(&rows).transpose()),
                api.vector(api.angular_velocity, id, &self.name)?,
            ),
            false => (DQuat::IDENTITY, DVec3::ZERO),
        };
        let reading = Reading {
            motion: Motion::Position {
                pose: Axes::X_TO_USER.pose(rotation, at),
                twist: Axes::X_TO_USER.twist(angular, linear),
            },
            // SAFETY: an open device.
            buttons: unsafe { (api.button_mask)(id) },
        };
        Ok(Exchange {
            reading: Some(reading),
            refused: None,
        })
    }
}

/// The capabilities of a device that cannot be opened: as little as any.
fn unknown_spec(index: u8) -> DeviceSpec {
    spec(&default_name(index), 0, false, false)
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

/// The name of a device until the library states one.
fn default_name(index: u8) -> String {
    format!("Force Dimension device {index}")
}

impl Drop for DhdDevice {
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

/// Every device of the library, each opened for a moment; `options` says by which library. What
/// cannot be opened is listed too, and says why in [`DeviceInfo::access`].
///
/// # Errors
/// If the library is not installed, too old or lacks a function, or there is no device.
pub fn find(options: &DhdOptions) -> Result<Vec<DeviceInfo>, DeviceError> {
    let api = Arc::new(Api::load(options.library.clone())?);
    // SAFETY: takes nothing.
    let count = unsafe { (api.device_count)() };
    api.check(count, "Force Dimension SDK")?;
    if count == 0 {
        return Err(DeviceError::NotReady {
            name: "Force Dimension SDK".into(),
            reason: "it is installed, but sees no device: is one switched on and plugged in, and \
                     may this user open it (the SDK's udev rules)?"
                .into(),
        });
    }
    // Places are numbered by a signed byte.
    let places = 0..u8::try_from(count).unwrap_or(u8::MAX).min(127);
    Ok(places.map(|index| device_info(&api, index)).collect())
}

fn device_info(api: &Arc<Api>, index: u8) -> DeviceInfo {
    let device = DhdDevice::new(Arc::clone(api), index);
    let (spec, serial, ready) = match device {
        Ok(device) => (device.spec(), device.serial(), device.check_ready()),
        Err(why) => (unknown_spec(index), None, Err(why)),
    };
    let serial = serial.map(|s| s.to_string()).unwrap_or_default();
    let kind = DeviceKind::ForceDimension;
    DeviceInfo::of_driver(kind, &index.to_string(), serial, spec, ready)
}

/// Opens the device as the loop wants it, its weight borne by its own gravity compensation.
///
/// # Errors
/// As [`find`], and if it is not calibrated or not the one wanted.
pub fn open(options: DhdOptions) -> Result<Box<dyn Device>, DeviceError> {
    let device = ThreadedDevice::exchanging(move || connect(&options))?;
    Ok(Box::new(device))
}

/// Opens the device that the options name, calibrated and ready to push.
fn connect(options: &DhdOptions) -> Result<(DhdDevice, DeviceSpec), DeviceError> {
    let api = Api::load(options.library.clone())?;
    let device = DhdDevice::new(Arc::new(api), options.index)?;
    let spec = device.spec();
    if let Some(wanted) = options.serial
        && device.serial() != Some(wanted)
    {
        return Err(DeviceError::Unsuitable {
            name: spec.name,
            expected: format!("serial number {wanted}"),
            found: (device.serial()).map_or_else(|| "none".to_owned(), |serial| serial.to_string()),
        });
    }
    device.check_ready()?;
    device.enable()?;
    Ok((device, spec))
}
