//! Devices: what the loop asks of one, hands without hardware, and those of this machine.
//!
//! [`attached`] finds and opens what this machine has: the HID devices of [`hid`] and, by their
//! makers' drivers, those of [`openhaptics`], [`force_dimension`] and [`haply`]. [`threaded`] makes
//! a device of two halves that block; [`conformance`] checks a device of your own.

pub mod attached;
pub mod conformance;
pub(crate) mod contract;
pub mod force_dimension;
mod frame;
pub(crate) mod hand_body;
pub mod haply;
pub mod hid;
pub mod info;
mod insertion;
mod library;
pub mod openhaptics;
pub(crate) mod script;
pub mod shown;
pub(crate) mod simulated;
pub(crate) mod steered;
pub mod threaded;
pub(crate) mod way;
pub(crate) mod workspace;
