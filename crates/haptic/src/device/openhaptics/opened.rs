//! A device of libHD: opened, described, pushed frame by frame, closed.

use std::ffi::c_uint;
use std::ptr::null;

use fft_correlate::{Twist, Wrench};
use glam::{DMat3, DQuat, DVec3};

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::frame::Axes;
use crate::device::openhaptics::api::{Api, Hhd, INVALID_HANDLE, parameter};
use crate::device::openhaptics::calibration::Style;
use crate::device::openhaptics::options::PhantomOptions;
use crate::device::openhaptics::words::{Fault, check, fault};
use crate::device::servo::turn::{Handle, Turn};

/// Metres per millimetre, and newton metres per newton millimetre.
const MILLI: f64 = 1e-3;

/// Stiffness \[N/m\] of a device that states none: little.
const SOFT: f64 = 500.0;

/// Rotational stiffness \[N·m/rad\] likewise.
const SOFT_ROTATION: f64 = 0.5;

/// An open device. Dropping it takes its force away and closes it.
pub(super) struct Opened {
    pub(super) api: Api,
    device: Hhd,
    name: String,
    style: Style,
    turns: bool,
    torque: bool,
    scheduled: bool,
}

/// What a device says of itself.
pub(super) struct Found {
    pub(super) spec: DeviceSpec,
    pub(super) serial: String,
}

impl Opened {
    /// Opens the device, without force.
    pub(super) fn new(api: Api, options: &PhantomOptions) -> Result<Self, DeviceError> {
        let name = options.called().to_owned();
        let c_name = options.c_name()?;
        let text = c_name.as_ref().map_or(null(), |name| name.as_ptr());
        // SAFETY: null or a text that ends with a zero byte.
        let device = unsafe { (api.init_device)(text) };
        let mut opened = Self {
            api,
            device,
            name,
            style: Style::default(),
            turns: false,
            torque: false,
            scheduled: false,
        };
        let (api, name) = (&opened.api, &opened.name);
        check(api, name)?;
        if device == INVALID_HANDLE {
            return Err(DeviceError::NotReady {
                name: name.clone(),
                reason: "the driver found no such device; is it switched on and plugged in?".into(),
            });
        }
        // SAFETY: an open device.
        unsafe { (api.make_current)(device) };
        opened.style = Style::of(api);
        opened.turns = api.integer(parameter::INPUT_DOF) >= 6;
        opened.torque = api.integer(parameter::OUTPUT_DOF) >= 6;
        Ok(opened)
    }

    /// What it can do, in its own numbers.
    pub(super) fn describe(&self) -> Found {
        let api = &self.api;
        let known = |value: f64, factor: f64, otherwise: f64| match value {
            value if value.is_finite() && value > 0.0 => value * factor,
            _ => otherwise,
        };
        let one = |what| api.doubles::<1>(what)[0];
        let reach = api.doubles::<6>(parameter::MAX_WORKSPACE);
        let reach = reach
            .iter()
            .fold(0.0, |most: f64, edge| most.max(edge.abs()));
        let torque = |what, factor, otherwise| match self.torque {
            true => known(one(what), factor, otherwise),
            false => otherwise,
        };
        let model = api.text(parameter::MODEL);
        let spec = DeviceSpec {
            name: format!("{} {model}", api.text(parameter::VENDOR))
                .trim()
                .to_owned(),
            input_dof: if self.turns { 6 } else { 3 },
            output_dof: if self.torque { 6 } else { 3 },
            rate_controlled: false,
            max_force: known(one(parameter::NOMINAL_MAX_FORCE), 1.0, 0.0),
            max_torque: torque(parameter::NOMINAL_MAX_TORQUE, MILLI, 0.0),
            max_stiffness: known(one(parameter::NOMINAL_MAX_STIFFNESS), 1.0 / MILLI, SOFT),
            max_rotational_stiffness: torque(
                parameter::NOMINAL_MAX_TORQUE_STIFFNESS,
                MILLI,
                SOFT_ROTATION,
            ),
            workspace: known(2.0 * reach, MILLI, f64::INFINITY),
            nominal_rate: match api.integer(parameter::UPDATE_RATE) {
                rate if rate > 0 => rate.into(),
                _ => 1000.0,
            },
        };
        let serial = api.text(parameter::SERIAL_NUMBER);
        // The library counts what the device does not know as errors.
        let _ = fault(api, &self.name);
        Found { spec, serial }
    }

    /// Starts the scheduler, without which nothing is measured, and waits until the device is
    /// calibrated.
    pub(super) fn calibrate(&mut self) -> Result<(), DeviceError> {
        if !self.scheduled {
            // SAFETY: takes nothing; stopped when this is dropped.
            unsafe { (self.api.start_scheduler)() };
            self.scheduled = true;
            check(&self.api, &self.name)?;
        }
        self.style.wait(&self.api, &self.name)
    }

    /// Lets the motors push.
    pub(super) fn enable(&self) -> Result<(), DeviceError> {
        // SAFETY: a capability of every device.
        unsafe { (self.api.enable)(parameter::FORCE_OUTPUT) };
        check(&self.api, &self.name)
    }

    /// Takes the force away, outside of any frame.
    pub(super) fn disable(&self) {
        // SAFETY: an open device and a capability of every device.
        unsafe {
            (self.api.make_current)(self.device);
            (self.api.disable)(parameter::FORCE_OUTPUT);
        }
    }

    /// One frame: reads the handle, pushes with `wrench`. Called by the scheduler.
    pub(super) fn frame(&self, wrench: &Wrench) -> Result<Turn, DeviceError> {
        let api = &self.api;
        // SAFETY: an open device, in a callback of its scheduler; the frame is ended below.
        unsafe { (api.make_current)(self.device) };
        let calibrated = self.style.holds(api);
        // SAFETY: as above.
        unsafe { (api.begin_frame)(self.device) };
        let handle = calibrated.then(|| self.handle());
        let wrench = if calibrated { *wrench } else { Wrench::ZERO };
        let force = Axes::Y_UP.to_maker(wrench.force);
        api.set(parameter::CURRENT_FORCE, force.to_array());
        if self.torque {
            let torque = Axes::Y_UP.to_maker(wrench.torque) / MILLI;
            api.set(parameter::CURRENT_TORQUE, torque.to_array());
        }
        // SAFETY: the frame begun above.
        unsafe { (api.end_frame)(self.device) };
        let refused = match fault(api, &self.name) {
            None => None,
            Some(Fault::Refused(why)) => Some(why),
            Some(Fault::Gone(why)) => return Err(why),
        };
        Ok(Turn { handle, refused })
    }

    /// The handle in this frame.
    fn handle(&self) -> Handle {
        let api = &self.api;
        let columns = api.doubles::<16>(parameter::CURRENT_TRANSFORM);
        let column = |c: usize| DVec3::from_slice(&columns[4 * c..]);
        let rotation = match self.turns {
            true => DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))),
            false => DQuat::IDENTITY,
        };
        let linear = vector(api, parameter::CURRENT_VELOCITY) * MILLI;
        let angular = match self.turns {
            true => vector(api, parameter::CURRENT_ANGULAR_VELOCITY),
            false => DVec3::ZERO,
        };
        Handle {
            pose: Axes::Y_UP.pose(rotation, column(3) * MILLI),
            twist: match linear.is_finite() && angular.is_finite() {
                true => Axes::Y_UP.twist(angular, linear),
                // Not measured.
                false => Twist::default(),
            },
            buttons: api.integer(parameter::CURRENT_BUTTONS).cast_unsigned(),
        }
    }
}

fn vector(api: &Api, what: c_uint) -> DVec3 {
    api.doubles::<3>(what).into()
}

impl Drop for Opened {
    fn drop(&mut self) {
        if self.device != INVALID_HANDLE {
            self.disable();
        }
        let api = &self.api;
        // SAFETY: the device is closed last; nothing is called with it any more.
        unsafe {
            if self.scheduled {
                (api.stop_scheduler)();
            }
            if self.device != INVALID_HANDLE {
                (api.disable_device)(self.device);
            }
        }
        // Closing may leave errors, which the next to open it would take for its own.
        let _ = fault(api, &self.name);
    }
}
