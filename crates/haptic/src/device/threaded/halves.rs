//! The two halves of a device, each of which may block.

use std::time::Duration;

use fft_correlate::{Pose, Twist, Wrench};

use crate::device::contract::DeviceError;

/// What a handle tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Its place, device frame.
    Position(Pose),
    /// How fast the cursor should move, rad/s and m/s, device frame.
    Rate(Twist),
}

/// One input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Place or rate.
    pub motion: Motion,
    /// Bit `i` is set while button `i` is held.
    pub buttons: u32,
}

/// The half of a device that is read.
pub trait InputHalf: Send {
    /// Opens it (again).
    ///
    /// # Errors
    /// If it is not there or the system refuses.
    fn connect(&mut self) -> Result<(), DeviceError>;

    /// Waits for input, `timeout` at most; `None` if there was none.
    ///
    /// # Errors
    /// If the device is gone; [`InputHalf::connect`] is tried then.
    fn read(&mut self, timeout: Duration) -> Result<Option<Reading>, DeviceError>;
}

/// The half of a device that is written.
pub trait OutputHalf: Send {
    /// Opens it (again) and makes it ready to push.
    ///
    /// # Errors
    /// If it is not there or the system refuses.
    fn connect(&mut self) -> Result<(), DeviceError>;

    /// Pushes with `wrench` from now on.
    ///
    /// # Errors
    /// If the device is gone; [`OutputHalf::connect`] is tried then.
    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError>;

    /// Takes every force away.
    ///
    /// # Errors
    /// If the device could not be told.
    fn stop_all(&mut self) -> Result<(), DeviceError>;
}
