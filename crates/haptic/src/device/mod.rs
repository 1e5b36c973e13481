//! Devices: what the loop asks of one, hands without hardware, and those of this machine.
//!
//! [`threaded`] makes a device of two halves that block; [`hid`] has the HID devices that are
//! known; [`conformance`] checks a device of your own.

pub mod conformance;
pub(crate) mod contract;
pub(crate) mod hand_body;
pub mod hid;
mod insertion;
pub(crate) mod script;
pub(crate) mod simulated;
pub(crate) mod steered;
pub mod threaded;
pub(crate) mod workspace;
