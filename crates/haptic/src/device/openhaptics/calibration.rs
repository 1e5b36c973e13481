//! Calibration: what the device needs before its poses mean anything.

use std::ffi::c_uint;
use std::time::{Duration, Instant};

use crate::device::contract::DeviceError;
use crate::device::openhaptics::api::{Api, parameter};

const OK: c_uint = 0x5000;
const NEEDS_UPDATE: c_uint = 0x5001;

const ENCODER_RESET: c_uint = 1;
const AUTO: c_uint = 1 << 1;
const INKWELL: c_uint = 1 << 2;

/// How long a device that calibrates itself may take.
const PATIENCE: Duration = Duration::from_millis(500);

/// Pause between two looks at it.
const REST: Duration = Duration::from_millis(5);

/// How the current device is calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Style(c_uint);

impl Style {
    /// The most comfortable of those the device has.
    pub(super) fn of(api: &Api) -> Self {
        let has = api.integer(parameter::CALIBRATION_STYLE).cast_unsigned();
        let mut best_first = [AUTO, INKWELL, ENCODER_RESET].into_iter();
        Self(best_first.find(|style| has & style != 0).unwrap_or(0))
    }

    /// Whether poses can be believed now; finishes a calibration that only waits for that. Not
    /// within a frame.
    pub(super) fn holds(self, api: &Api) -> bool {
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
    pub(super) fn wait(self, api: &Api, name: &str) -> Result<(), DeviceError> {
        let begin = Instant::now();
        while !self.holds(api) {
            if begin.elapsed() > PATIENCE {
                return Err(self.missing(name));
            }
            std::thread::sleep(REST);
        }
        Ok(())
    }

    fn missing(self, name: &str) -> DeviceError {
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
