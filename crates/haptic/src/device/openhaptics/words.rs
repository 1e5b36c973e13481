//! The library's error stack in our errors.

use std::ffi::c_uint;

use crate::device::contract::DeviceError;
use crate::device::openhaptics::api::{Api, ErrorInfo};

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
pub(super) fn fault(api: &Api, name: &str) -> Option<Fault> {
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
    let told = told(api, name, error);
    Some(match is_refusal(error.code) {
        true => Fault::Refused(told),
        false => Fault::Gone(told),
    })
}

/// The same, an error of any kind being one.
pub(super) fn check(api: &Api, name: &str) -> Result<(), DeviceError> {
    match fault(api, name) {
        None => Ok(()),
        Some(Fault::Refused(error) | Fault::Gone(error)) => Err(error),
    }
}

/// Force errors: the device stays, the force does not.
fn is_refusal(code: c_uint) -> bool {
    (0x0200..0x0300).contains(&code)
}

fn told(api: &Api, name: &str, error: ErrorInfo) -> DeviceError {
    let ErrorInfo { code, internal, .. } = error;
    let (what, help) = meaning(code);
    let words = api.words(code);
    let words = match words.trim() {
        "" => String::new(),
        words => format!(": {words}"),
    };
    let reason = format!("{what} ({code:#06x}, {internal}){words}{help}");
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
