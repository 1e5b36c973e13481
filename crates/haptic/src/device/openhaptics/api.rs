//! The functions of libHD that are used, and its numbers.

use std::ffi::{CStr, c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::path::PathBuf;

use crate::device::contract::DeviceError;
use crate::device::driver::{Driver, DriverSource};
use crate::device::text::printable;

/// Where libHD lies.
pub(super) const DRIVER: DriverSource = DriverSource {
    name: "OpenHaptics",
    files: if cfg!(windows) {
        &["hd.dll"]
    } else {
        &["libHD.so", "libHD.so.3.4", "libHD.so.3.0"]
    },
    variable: "PEGFIT_LIBHD",
    help: "install OpenHaptics and the Touch device driver of 3D Systems",
    versions: "OpenHaptics 3.0 or later",
};

/// Handle of a device.
pub(super) type Hhd = c_uint;

/// What [`Api::init_device`] gives if there is none.
pub(super) const INVALID_HANDLE: Hhd = 0xffff_ffff;

/// An error of the library's stack; code zero is none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ErrorInfo {
    pub(super) code: c_uint,
    pub(super) internal: c_int,
    pub(super) device: Hhd,
}

/// A servo: user data in, [`CALLBACK_CONTINUE`] or [`CALLBACK_DONE`] out.
pub(super) type Callback = unsafe extern "system" fn(*mut c_void) -> c_uint;

pub(super) const CALLBACK_DONE: c_uint = 0;
pub(super) const CALLBACK_CONTINUE: c_uint = 1;

/// The highest priority: the only servo of the process.
pub(super) const MAX_PRIORITY: c_ushort = c_ushort::MAX;

/// What can be asked for and set.
pub(super) mod parameter {
    use std::ffi::c_uint;

    pub(crate) const CURRENT_BUTTONS: c_uint = 0x2000;
    /// mm/s.
    pub(crate) const CURRENT_VELOCITY: c_uint = 0x2051;
    /// 4 x 4, columns first, mm.
    pub(crate) const CURRENT_TRANSFORM: c_uint = 0x2052;
    /// rad/s.
    pub(crate) const CURRENT_ANGULAR_VELOCITY: c_uint = 0x2053;
    pub(crate) const MODEL: c_uint = 0x2501;
    pub(crate) const VENDOR: c_uint = 0x2503;
    pub(crate) const SERIAL_NUMBER: c_uint = 0x2504;
    /// Least x, y, z, greatest x, y, z, mm.
    pub(crate) const MAX_WORKSPACE: c_uint = 0x2550;
    pub(crate) const INPUT_DOF: c_uint = 0x2553;
    pub(crate) const OUTPUT_DOF: c_uint = 0x2554;
    pub(crate) const CALIBRATION_STYLE: c_uint = 0x2555;
    /// Hz.
    pub(crate) const UPDATE_RATE: c_uint = 0x2600;
    /// N/mm.
    pub(crate) const NOMINAL_MAX_STIFFNESS: c_uint = 0x2602;
    /// N.
    pub(crate) const NOMINAL_MAX_FORCE: c_uint = 0x2603;
    /// mN·m/rad.
    pub(crate) const NOMINAL_MAX_TORQUE_STIFFNESS: c_uint = 0x2620;
    /// mN·m.
    pub(crate) const NOMINAL_MAX_TORQUE: c_uint = 0x2622;
    /// N.
    pub(crate) const CURRENT_FORCE: c_uint = 0x2700;
    /// mN·m, Cartesian.
    pub(crate) const CURRENT_TORQUE: c_uint = 0x2701;
    /// A capability.
    pub(crate) const FORCE_OUTPUT: c_uint = 0x4000;
}

/// Declares the functions once: a field each, and how it is found.
macro_rules! functions {
    ($($(#[$doc:meta])* $field:ident = $symbol:literal: fn($($arg:ty),*) $(-> $out:ty)?;)*) => {
        /// The loaded library.
        #[derive(Debug)]
        pub(super) struct Api {
            $($(#[$doc])* pub(super) $field: unsafe extern "system" fn($($arg),*) $(-> $out)?,)*
        }

        impl Api {
            /// Loads `file`, else the installed library.
            pub(super) fn load(file: Option<PathBuf>) -> Result<Self, DeviceError> {
                let driver = Driver::load(DRIVER, file)?;
                // SAFETY: the types are those of OpenHaptics' public API reference.
                unsafe { Ok(Self { $($field: driver.function($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    init_device = "hdInitDevice": fn(*const c_char) -> Hhd;
    disable_device = "hdDisableDevice": fn(Hhd);
    make_current = "hdMakeCurrentDevice": fn(Hhd);
    enable = "hdEnable": fn(c_uint);
    disable = "hdDisable": fn(c_uint);
    begin_frame = "hdBeginFrame": fn(Hhd);
    end_frame = "hdEndFrame": fn(Hhd);
    get_doubles = "hdGetDoublev": fn(c_uint, *mut c_double);
    get_integers = "hdGetIntegerv": fn(c_uint, *mut c_int);
    get_string = "hdGetString": fn(c_uint) -> *const c_char;
    set_doubles = "hdSetDoublev": fn(c_uint, *const c_double);
    get_error = "hdGetError": fn() -> ErrorInfo;
    error_string = "hdGetErrorString": fn(c_uint) -> *const c_char;
    check_calibration = "hdCheckCalibration": fn() -> c_uint;
    update_calibration = "hdUpdateCalibration": fn(c_uint);
    start_scheduler = "hdStartScheduler": fn();
    stop_scheduler = "hdStopScheduler": fn();
    schedule = "hdScheduleAsynchronous": fn(Callback, *mut c_void, c_ushort) -> c_ulong;
    unschedule = "hdUnschedule": fn(c_ulong);
}

impl Api {
    /// `N` numbers of the current device; not a number where it says nothing.
    pub(super) fn doubles<const N: usize>(&self, what: c_uint) -> [f64; N] {
        // No parameter has more than sixteen.
        let mut values = [f64::NAN; 16];
        // SAFETY: the buffer has room for every parameter asked for here.
        unsafe { (self.get_doubles)(what, values.as_mut_ptr()) };
        std::array::from_fn(|k| values[k])
    }

    /// A number of the current device, zero where it says nothing.
    pub(super) fn integer(&self, what: c_uint) -> c_int {
        let mut value = 0;
        // SAFETY: the parameters asked for here have one number each.
        unsafe { (self.get_integers)(what, &raw mut value) };
        value
    }

    /// A text of the current device, empty where it says nothing.
    pub(super) fn text(&self, what: c_uint) -> String {
        // SAFETY: the library gives a text of its own that lasts, or null.
        text(unsafe { (self.get_string)(what) })
    }

    /// Sets three numbers of the current device's frame.
    pub(super) fn set(&self, what: c_uint, values: [f64; 3]) {
        // SAFETY: the parameters set here have three numbers each.
        unsafe { (self.set_doubles)(what, values.as_ptr()) };
    }

    /// The library's text for an error.
    pub(super) fn error_text(&self, code: c_uint) -> String {
        // SAFETY: the library gives a text of its own that lasts, or null.
        text(unsafe { (self.error_string)(code) })
    }
}

/// A text of the library, fit to be shown; empty where there is none.
fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the library ends its texts with a zero byte.
    let text = unsafe { CStr::from_ptr(text) };
    printable(&text.to_string_lossy())
}

/// Most errors taken from the stack at once.
const DEPTH: usize = 16;

/// What an error means for a device that is held.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Fault {
    /// The device took the force away by itself: too much of it, too fast, warm motors.
    Refused(DeviceError),
    /// It does not work any more.
    Gone(DeviceError),
}

/// Empties the error stack; the worst of it, `None` if it was empty.
pub(super) fn take_fault(api: &Api, name: &str) -> Option<Fault> {
    let mut worst: Option<ErrorInfo> = None;
    for _ in 0..DEPTH {
        // SAFETY: takes nothing and gives a plain record.
        let error = unsafe { (api.get_error)() };
        if error.code == 0 {
            break;
        }
        if worst.is_none_or(|w| is_refusal(w.code) && !is_refusal(error.code)) {
            worst = Some(error);
        }
    }
    let error = worst?;
    let refusal = is_refusal(error.code);
    let error = device_error(api, name, error);
    Some(match refusal {
        true => Fault::Refused(error),
        false => Fault::Gone(error),
    })
}

/// The same, an error of any kind being one.
pub(super) fn check(api: &Api, name: &str) -> Result<(), DeviceError> {
    match take_fault(api, name) {
        None => Ok(()),
        Some(Fault::Refused(error) | Fault::Gone(error)) => Err(error),
    }
}

/// Force errors: the device stays, the force does not.
fn is_refusal(code: c_uint) -> bool {
    (0x0200..0x0300).contains(&code)
}

fn device_error(api: &Api, name: &str, error: ErrorInfo) -> DeviceError {
    let ErrorInfo { code, internal, .. } = error;
    let (what, help) = meaning(code);
    let text = api.error_text(code);
    let text = match text.trim() {
        "" => String::new(),
        text => format!(": {text}"),
    };
    let reason = format!("{what} ({code:#06x}, {internal}){text}{help}");
    let name = name.to_owned();
    match code {
        0x0200..=0x0204 => DeviceError::NotReady { name, reason },
        _ => DeviceError::System { name, reason },
    }
}

/// The library's name of an error, and what would help.
fn meaning(code: c_uint) -> (&'static str, &'static str) {
    const REACH: &str = "; is it switched on and its cable plugged in, does no other program hold \
                         it, and may this user open it (the driver's udev rules, /dev/ttyACM*)?";
    const NAME: &str = "; does the maker's setup program know a device of this name, and has its \
                        test passed there?";
    match code {
        0x0100 => ("HD_INVALID_ENUM", ""),
        0x0101 => ("HD_INVALID_VALUE", NAME),
        0x0102 => ("HD_INVALID_OPERATION", ""),
        0x0103 => ("HD_INVALID_INPUT_TYPE", ""),
        0x0104 => ("HD_BAD_HANDLE", ""),
        0x0200 => ("HD_WARM_MOTORS", "; let it rest"),
        0x0201 => ("HD_EXCEEDED_MAX_FORCE", ""),
        0x0202 => ("HD_EXCEEDED_MAX_FORCE_IMPULSE", ""),
        0x0203 => ("HD_EXCEEDED_MAX_VELOCITY", ""),
        0x0204 => ("HD_FORCE_ERROR", ""),
        0x0300 => ("HD_DEVICE_FAULT", REACH),
        0x0301 => ("HD_DEVICE_ALREADY_INITIATED", ""),
        0x0302 => ("HD_COMM_ERROR", REACH),
        0x0303 => ("HD_COMM_CONFIG_ERROR", REACH),
        0x0304 => ("HD_TIMER_ERROR", "; does another program hold the device?"),
        0x0400 => ("HD_ILLEGAL_BEGIN", ""),
        0x0401 => ("HD_ILLEGAL_END", ""),
        0x0402 => ("HD_FRAME_ERROR", ""),
        0x0500 => ("HD_INVALID_PRIORITY", ""),
        0x0501 => ("HD_SCHEDULER_FULL", ""),
        0x0600 => ("HD_INVALID_LICENSE", "; install the maker's licence"),
        _ => ("unknown error", ""),
    }
}
