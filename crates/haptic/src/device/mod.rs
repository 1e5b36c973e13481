//! Devices: what the loop asks of one, hands without hardware, and those of this machine.
//!
//! [`attached`] finds and opens what this machine has: the HID devices of [`hid`] and, by their
//! makers' drivers, those of [`openhaptics`], [`force_dimension`] and [`haply`]. [`threaded`] makes
//! a device of two halves that block; [`conformance`] checks a device of your own.

pub mod attached;
pub mod conformance;
pub(crate) mod contract;
mod driver;
pub mod force_dimension;
pub mod haply;
pub mod hid;
pub mod info;
pub mod openhaptics;
pub(crate) mod remote;
pub(crate) mod script;
pub(crate) mod simulated;
pub mod text;
pub mod threaded;
pub(crate) mod timed_path;
pub(crate) mod workspace;
