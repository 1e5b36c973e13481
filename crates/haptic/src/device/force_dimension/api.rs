//! The functions of libdhd that are used, and its numbers.

use std::ffi::{CStr, c_char, c_double, c_int, c_uchar, c_uint, c_ushort};
use std::path::PathBuf;

use glam::DVec3;

use crate::device::contract::DeviceError;
use crate::device::driver::{Driver, DriverSource};
use crate::device::text::printable;

/// Where libdhd lies.
pub(super) const DRIVER: DriverSource = DriverSource {
    name: "Force Dimension SDK",
    files: if cfg!(windows) {
        &["dhd64.dll"]
    } else if cfg!(target_os = "macos") {
        &["libdhd.dylib", "/usr/local/lib/libdhd.dylib"]
    } else {
        &["libdhd.so", "libdhd.so.3", "/usr/local/lib/libdhd.so.3"]
    },
    variable: "PEGFIT_LIBDHD",
    help: "install the Force Dimension SDK",
    versions: "the Force Dimension SDK 3.7 or later",
};

/// An open device.
pub(super) type Id = c_char;

pub(super) const ON: c_int = 1;

/// Entries of the status vector that are used.
pub(super) mod status {
    pub(crate) const POWER: usize = 0;
    /// Whether the device is calibrated.
    pub(crate) const RESET: usize = 3;
    /// Entries there is room for: sixteen, and what later versions add.
    pub(crate) const ROOM: usize = 64;
}

/// Error codes that say what to do.
mod error {
    use std::ffi::c_int;

    pub(super) const BUSY: c_int = 3;
    pub(super) const NO_DRIVER: c_int = 4;
    pub(super) const NO_DEVICE: c_int = 5;
    pub(super) const NOT_READY: c_int = 12;
    pub(super) const IN_USE: c_int = 20;
}

/// Declares the functions once: a field each, and how it is found.
macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($arg:ty),*) $(-> $out:ty)?;)*) => {
        /// The loaded library.
        #[derive(Debug)]
        pub(super) struct Api {
            $(pub(super) $field: unsafe extern "system" fn($($arg),*) $(-> $out)?,)*
        }

        impl Api {
            /// Loads `file`, else the installed library.
            pub(super) fn load(file: Option<PathBuf>) -> Result<Self, DeviceError> {
                let driver = Driver::load(DRIVER, file)?;
                // SAFETY: the types are those of the Force Dimension SDK's public reference.
                let api = unsafe { Self { $($field: driver.function($symbol)?,)* } };
                api.check_version()?;
                Ok(api)
            }
        }
    };
}

functions! {
    sdk_version = "dhdGetSDKVersion": fn(*mut c_int, *mut c_int, *mut c_int, *mut c_int);
    device_count = "dhdGetDeviceCount": fn() -> c_int;
    open_id = "dhdOpenID": fn(c_char) -> c_int;
    close = "dhdClose": fn(Id) -> c_int;
    stop = "dhdStop": fn(Id) -> c_int;
    last_error = "dhdErrorGetLast": fn() -> c_int;
    last_error_text = "dhdErrorGetLastStr": fn() -> *const c_char;
    system_name = "dhdGetSystemName": fn(Id) -> *const c_char;
    system_type = "dhdGetSystemType": fn(Id) -> c_int;
    serial_number = "dhdGetSerialNumber": fn(*mut c_ushort, Id) -> c_int;
    status = "dhdGetStatus": fn(*mut c_int, Id) -> c_int;
    // C++ `bool`, a byte.
    has_wrist = "dhdHasWrist": fn(Id) -> c_uchar;
    has_active_wrist = "dhdHasActiveWrist": fn(Id) -> c_uchar;
    set_gravity_compensation = "dhdSetGravityCompensation": fn(c_int, Id) -> c_int;
    enable_force = "dhdEnableForce": fn(c_uchar, Id) -> c_int;
    pose = "dhdGetPositionAndOrientationFrame":
        fn(*mut c_double, *mut c_double, *mut c_double, *mut [[c_double; 3]; 3], Id) -> c_int;
    linear_velocity = "dhdGetLinearVelocity":
        fn(*mut c_double, *mut c_double, *mut c_double, Id) -> c_int;
    angular_velocity = "dhdGetAngularVelocityRad":
        fn(*mut c_double, *mut c_double, *mut c_double, Id) -> c_int;
    button_mask = "dhdGetButtonMask": fn(Id) -> c_uint;
    set_wrench = "dhdSetForceAndTorqueAndGripperForce":
        fn(c_double, c_double, c_double, c_double, c_double, c_double, c_double, Id) -> c_int;
}

/// A function that gives three numbers.
pub(super) type Vector =
    unsafe extern "system" fn(*mut c_double, *mut c_double, *mut c_double, Id) -> c_int;

impl Api {
    fn check_version(&self) -> Result<(), DeviceError> {
        let mut v: [c_int; 4] = [0; 4];
        let [major, minor, release, revision] = &mut v;
        // SAFETY: four numbers to fill.
        unsafe { (self.sdk_version)(major, minor, release, revision) };
        match v {
            [3, minor, ..] if minor >= 7 => Ok(()),
            [major, ..] if major > 3 => Ok(()),
            [major, minor, release, _] => Err(DeviceError::Unsuitable {
                name: DRIVER.name.into(),
                expected: "version 3.7 or later".into(),
                found: format!("version {major}.{minor}.{release}"),
            }),
        }
    }

    /// What went wrong last.
    pub(super) fn error(&self, name: &str) -> DeviceError {
        // SAFETY: these take nothing; the text is the library's own and lasts.
        let (code, message) = unsafe { ((self.last_error)(), (self.last_error_text)()) };
        let help = match code {
            error::BUSY | error::IN_USE => "; does another program hold it?",
            error::NO_DRIVER => "; install the USB driver of the SDK",
            error::NO_DEVICE => {
                "; is it switched on and plugged in, and may this user open it (the SDK's udev \
                 rules)?"
            }
            error::NOT_READY => "; is it switched on and calibrated?",
            _ => "",
        };
        let reason = format!("{} ({code}){help}", driver_text(message));
        let name = name.to_owned();
        match code {
            error::BUSY | error::IN_USE | error::NO_DEVICE | error::NOT_READY => {
                DeviceError::NotReady { name, reason }
            }
            _ => DeviceError::System { name, reason },
        }
    }

    /// Three numbers of a device.
    pub(super) fn vector(&self, read: Vector, id: Id, name: &str) -> Result<DVec3, DeviceError> {
        let mut v = DVec3::ZERO;
        // SAFETY: three numbers to fill.
        let code = unsafe { read(&raw mut v.x, &raw mut v.y, &raw mut v.z, id) };
        self.check(code, name).map(|()| v)
    }

    /// Whether a call succeeded; positive codes are remarks (a saturated motor, a call too soon).
    pub(super) fn check(&self, code: c_int, name: &str) -> Result<(), DeviceError> {
        match code {
            0.. => Ok(()),
            _ => Err(self.error(name)),
        }
    }
}

/// A text of the library, fit to be shown; empty where there is none.
pub(super) fn driver_text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the library ends its texts with a zero byte.
    let text = unsafe { CStr::from_ptr(text) };
    printable(&text.to_string_lossy())
}
