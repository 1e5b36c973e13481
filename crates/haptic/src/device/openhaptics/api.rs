//! The functions of libHD that are used, and its numbers.

use std::ffi::{CStr, c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::path::PathBuf;

use crate::device::contract::DeviceError;
use crate::device::library::{Driver, Wanted};
use crate::device::shown::shown;

/// Where libHD lies.
pub(super) const WANTED: Wanted = Wanted {
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
                let driver = Driver::load(WANTED, file)?;
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

    /// The library's words for an error.
    pub(super) fn words(&self, code: c_uint) -> String {
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
    shown(&text.to_string_lossy())
}
