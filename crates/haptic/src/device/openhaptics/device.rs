//! A device of libHD: options, calibration, description, and frames called by its scheduler.

use std::ffi::{CString, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::ptr::null;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use fft_correlate::{Twist, Wrench};
use glam::{DMat3, DQuat, DVec3};

use crate::device::contract::{Device, DeviceError, DeviceSpec};
use crate::device::driver::Axes;
use crate::device::info::{DeviceInfo, DeviceKind};
use crate::device::openhaptics::api::{
    Api, CALLBACK_CONTINUE, CALLBACK_DONE, DRIVER, Fault, Hhd, INVALID_HANDLE, MAX_PRIORITY, check,
    parameter, take_fault,
};
use crate::device::threaded::{Exchange, Link, Motion, OpenDevice, Reading, ThreadedDevice};

/// Which device, and by which library.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PhantomOptions {
    /// The name that the maker's setup program gave it; `None` for the default device.
    pub name: Option<String>,
    /// File of the library; `None` for the installed one.
    pub library: Option<PathBuf>,
}

impl PhantomOptions {
    /// The device of this name, by the library that `PEGFIT_LIBHD` names, else the installed one.
    pub fn from_env(name: Option<&str>) -> Self {
        Self {
            name: name.map(str::to_owned),
            library: DRIVER.file_in_env(),
        }
    }

    /// What the driver calls it.
    fn driver_name(&self) -> &str {
        self.name.as_deref().unwrap_or("Default Device")
    }

    /// The same for the driver; `None` stands for the default.
    fn c_name(&self) -> Result<Option<CString>, DeviceError> {
        let name = self.name.as_deref().map(CString::new).transpose();
        name.map_err(|_| DeviceError::Unsuitable {
            name: self.driver_name().to_owned(),
            expected: "a name without zero bytes".into(),
            found: "one".into(),
        })
    }
}

/// Metres per millimetre, and newton metres per newton millimetre.
const MILLI: f64 = 1e-3;

/// Stiffness \[N/m\] of a device that states none: little.
const SOFT: f64 = 500.0;

/// Rotational stiffness \[N·m/rad\] likewise.
const SOFT_ROTATION: f64 = 0.5;

/// An open device. Dropping it takes its force away and closes it.
struct PhantomDevice {
    api: Api,
    handle: Hhd,
    name: String,
    style: CalibrationStyle,
    turns: bool,
    torque: bool,
    scheduled: bool,
}

/// What a device says of itself.
struct Description {
    spec: DeviceSpec,
    serial: String,
}

impl PhantomDevice {
    /// Opens the device, without force.
    fn new(api: Api, options: &PhantomOptions) -> Result<Self, DeviceError> {
        let name = options.driver_name().to_owned();
        let c_name = options.c_name()?;
        let text = c_name.as_ref().map_or(null(), |name| name.as_ptr());
        // SAFETY: null or a text that ends with a zero byte.
        let handle = unsafe { (api.init_device)(text) };
        let mut device = Self {
            api,
            handle,
            name,
            style: CalibrationStyle::default(),
            turns: false,
            torque: false,
            scheduled: false,
        };
        let (api, name) = (&device.api, &device.name);
        check(api, name)?;
        if handle == INVALID_HANDLE {
            return Err(DeviceError::NotReady {
                name: name.clone(),
                reason: "the driver found no such device; is it switched on and plugged in?".into(),
            });
        }
        // SAFETY: an open device.
        unsafe { (api.make_current)(handle) };
        device.style = CalibrationStyle::best(api);
        device.turns = api.integer(parameter::INPUT_DOF) >= 6;
        device.torque = api.integer(parameter::OUTPUT_DOF) >= 6;
        Ok(device)
    }

    /// What it can do, in its own numbers.
    fn describe(&self) -> Description {
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
        let _ = take_fault(api, &self.name);
        Description { spec, serial }
    }

    /// Starts the scheduler, without which nothing is measured, and waits until the device is
    /// calibrated.
    fn calibrate(&mut self) -> Result<(), DeviceError> {
        if !self.scheduled {
            // SAFETY: takes nothing; stopped when this is dropped.
            unsafe { (self.api.start_scheduler)() };
            self.scheduled = true;
            check(&self.api, &self.name)?;
        }
        self.style.wait(&self.api, &self.name)
    }

    /// Lets the motors push.
    fn enable(&self) -> Result<(), DeviceError> {
        // SAFETY: a capability of every device.
        unsafe { (self.api.enable)(parameter::FORCE_OUTPUT) };
        check(&self.api, &self.name)
    }

    /// Takes the force away, outside of any frame.
    fn disable(&self) {
        // SAFETY: an open device and a capability of every device.
        unsafe {
            (self.api.make_current)(self.handle);
            (self.api.disable)(parameter::FORCE_OUTPUT);
        }
    }

    /// One frame: reads the handle, pushes with `wrench`. Called by the scheduler.
    fn frame(&self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
        let api = &self.api;
        // SAFETY: an open device, in a callback of its scheduler; the frame is ended below.
        unsafe { (api.make_current)(self.handle) };
        let calibrated = self.style.is_calibrated(api);
        // SAFETY: as above.
        unsafe { (api.begin_frame)(self.handle) };
        let reading = calibrated.then(|| self.reading());
        let wrench = if calibrated { *wrench } else { Wrench::ZERO };
        let force = Axes::Y_UP.to_maker(wrench.force);
        api.set(parameter::CURRENT_FORCE, force.to_array());
        if self.torque {
            let torque = Axes::Y_UP.to_maker(wrench.torque) / MILLI;
            api.set(parameter::CURRENT_TORQUE, torque.to_array());
        }
        // SAFETY: the frame begun above.
        unsafe { (api.end_frame)(self.handle) };
        let refused = match take_fault(api, &self.name) {
            None => None,
            Some(Fault::Refused(why)) => Some(why),
            Some(Fault::Gone(why)) => return Err(why),
        };
        Ok(Exchange { reading, refused })
    }

    /// The handle in this frame.
    fn reading(&self) -> Reading {
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
        let twist = match linear.is_finite() && angular.is_finite() {
            true => Axes::Y_UP.twist(angular, linear),
            // Not measured.
            false => Twist::default(),
        };
        let pose = Axes::Y_UP.pose(rotation, column(3) * MILLI);
        Reading {
            motion: Motion::Position { pose, twist },
            buttons: api.integer(parameter::CURRENT_BUTTONS).cast_unsigned(),
        }
    }
}

impl OpenDevice for PhantomDevice {
    fn exchange(&mut self, wrench: &Wrench) -> Result<Exchange, DeviceError> {
        self.frame(wrench)
    }

    fn serve(self, link: &mut Link) -> Result<(), DeviceError> {
        serve_scheduled(&self, link)
    }
}

fn vector(api: &Api, what: c_uint) -> DVec3 {
    api.doubles::<3>(what).into()
}

impl Drop for PhantomDevice {
    fn drop(&mut self) {
        if self.handle != INVALID_HANDLE {
            self.disable();
        }
        let api = &self.api;
        // SAFETY: the device is closed last; nothing is called with it any more.
        unsafe {
            if self.scheduled {
                (api.stop_scheduler)();
            }
            if self.handle != INVALID_HANDLE {
                (api.disable_device)(self.handle);
            }
        }
        // Closing may leave errors, which the next to open it would take for its own.
        let _ = take_fault(api, &self.name);
    }
}

/// The device, opened for a moment: the library cannot list devices otherwise.
///
/// # Errors
/// If the library is not installed or lacks a function, or the device cannot be opened at all. One
/// that only wants to be calibrated is listed, and says so in [`DeviceInfo::access`].
pub fn find(options: &PhantomOptions) -> Result<DeviceInfo, DeviceError> {
    let api = Api::load(options.library.clone())?;
    let mut device = PhantomDevice::new(api, options)?;
    let Description { spec, serial } = device.describe();
    let (kind, id) = (DeviceKind::OpenHaptics, options.driver_name());
    let ready = device.calibrate();
    Ok(DeviceInfo::of_driver(kind, id, serial, spec, ready))
}

/// Opens the device as the loop wants it. The library can do so for one device of a process at a
/// time.
///
/// # Errors
/// As [`find`], and if it is not calibrated.
pub fn open(options: PhantomOptions) -> Result<Box<dyn Device>, DeviceError> {
    let device = ThreadedDevice::exchanging(move || connect(&options))?;
    Ok(Box::new(device))
}

/// Opens the device that the options name, calibrated and ready to push.
fn connect(options: &PhantomOptions) -> Result<(PhantomDevice, DeviceSpec), DeviceError> {
    let api = Api::load(options.library.clone())?;
    let mut device = PhantomDevice::new(api, options)?;
    let spec = device.describe().spec;
    device.calibrate()?;
    device.enable()?;
    Ok((device, spec))
}

/// Pause between two checks of the servo.
const REST: Duration = Duration::from_millis(1);

/// Time without a call of the servo after which the device is without force: nobody could take it
/// away.
const LATE: Duration = Duration::from_millis(12);

/// Longest time without a call of the servo before the scheduler counts as dead.
const PATIENCE: Duration = Duration::from_millis(100);

/// What the callback works with, and what it leaves.
struct Shared<'a> {
    device: &'a PhantomDevice,
    /// The link while it serves. Only the callback locks it for long, and only it changes it.
    inner: Mutex<Inner<'a>>,
}

struct Inner<'a> {
    link: &'a mut Link,
    called: Instant,
    /// The motors are off because the scheduler was late.
    off: bool,
    ended: Option<Result<(), DeviceError>>,
}

/// Lets the scheduler call the servo until it has to quit or fails. On return it is not called
/// any more.
fn serve_scheduled(device: &PhantomDevice, link: &mut Link) -> Result<(), DeviceError> {
    let shared = Shared {
        device,
        inner: Mutex::new(Inner {
            link,
            called: Instant::now(),
            off: false,
            ended: None,
        }),
    };
    let api = &device.api;
    let data = (&raw const shared).cast_mut().cast::<c_void>();
    // SAFETY: `shared` outlives the callback: the scheduler is stopped before `shared` goes.
    let handle = unsafe { (api.schedule)(tick, data, MAX_PRIORITY) };
    let result = wait(&shared);
    // SAFETY: scheduled above; a stopped scheduler has no callback running.
    unsafe {
        (api.stop_scheduler)();
        (api.unschedule)(handle);
    }
    result
}

fn wait(shared: &Shared<'_>) -> Result<(), DeviceError> {
    loop {
        std::thread::sleep(REST);
        let mut inner = shared.inner.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(result) = inner.ended.take() {
            return result;
        }
        let silence = inner.called.elapsed();
        if silence > PATIENCE {
            // Whatever comes later finds that it is over.
            inner.ended = Some(Ok(()));
            return Err(scheduler_silent(PATIENCE));
        }
        if silence > LATE && !inner.off {
            shared.device.disable();
            inner.off = true;
        }
    }
}

fn scheduler_silent(lasting: Duration) -> DeviceError {
    DeviceError::System {
        name: "OpenHaptics".into(),
        reason: format!(
            "the scheduler has not called for {} s",
            lasting.as_secs_f64()
        ),
    }
}

/// The callback.
unsafe extern "system" fn tick(data: *mut c_void) -> c_uint {
    // SAFETY: what `serve` scheduled, which stops the scheduler before it goes.
    let shared = unsafe { &*data.cast::<Shared<'_>>() };
    let mut inner = shared.inner.lock().unwrap_or_else(PoisonError::into_inner);
    if inner.ended.is_some() {
        return CALLBACK_DONE;
    }
    inner.called = Instant::now();
    let (last, off) = (inner.link.must_quit(), inner.off);
    let link = &mut *inner.link;
    // A panic may not leave through the scheduler's frames.
    let answer = catch_unwind(AssertUnwindSafe(|| {
        link.exchange(|wrench| {
            let mut answer = shared.device.frame(wrench)?;
            if off {
                // Still without force in this frame; from the next on it rises.
                answer.refused = Some(scheduler_silent(LATE));
                shared.device.enable()?;
            }
            Ok(answer)
        })
    }));
    inner.off = false;
    inner.ended = match answer {
        Ok(Ok(())) if !last => return CALLBACK_CONTINUE,
        Ok(result) => Some(result),
        Err(_) => Some(Err(DeviceError::Disconnected)),
    };
    CALLBACK_DONE
}

const OK: c_uint = 0x5000;
const NEEDS_UPDATE: c_uint = 0x5001;

const ENCODER_RESET: c_uint = 1;
const AUTO: c_uint = 1 << 1;
const INKWELL: c_uint = 1 << 2;

/// How long a device that calibrates itself may take.
const CALIBRATION_PATIENCE: Duration = Duration::from_millis(500);

/// Pause between two checks of the calibration.
const CALIBRATION_REST: Duration = Duration::from_millis(5);

/// How the current device is calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct CalibrationStyle(c_uint);

impl CalibrationStyle {
    /// The most comfortable of those the device has.
    fn best(api: &Api) -> Self {
        let has = api.integer(parameter::CALIBRATION_STYLE).cast_unsigned();
        let mut best_first = [AUTO, INKWELL, ENCODER_RESET].into_iter();
        Self(best_first.find(|style| has & style != 0).unwrap_or(0))
    }

    /// Whether poses can be believed now; finishes a calibration that only waits for that. Not
    /// within a frame.
    fn is_calibrated(self, api: &Api) -> bool {
        // SAFETY: takes nothing.
        let state = unsafe { (api.check_calibration)() };
        // Resetting the encoders is right in one posture only, which nobody has been asked for.
        if state == NEEDS_UPDATE && self.0 != ENCODER_RESET {
            // SAFETY: the device said that it has this style.
            unsafe { (api.update_calibration)(self.0) };
        }
        state == OK
    }

    /// Waits until the device is calibrated; the scheduler runs.
    fn wait(self, api: &Api, name: &str) -> Result<(), DeviceError> {
        let begin = Instant::now();
        while !self.is_calibrated(api) {
            if begin.elapsed() > CALIBRATION_PATIENCE {
                return Err(self.not_calibrated(name));
            }
            std::thread::sleep(CALIBRATION_REST);
        }
        Ok(())
    }

    fn not_calibrated(self, name: &str) -> DeviceError {
        let reason = match self.0 {
            INKWELL => {
                "it is not calibrated: put the stylus into the inkwell until its light is steady"
            }
            AUTO => {
                "it is not calibrated: move its arm through its whole reach, or run the maker's \
                 diagnostic program"
            }
            _ => {
                "it is not calibrated: put its arm into the reset posture, all links at right \
                 angles, and run the maker's calibration program"
            }
        };
        DeviceError::NotReady {
            name: name.to_owned(),
            reason: reason.into(),
        }
    }
}
