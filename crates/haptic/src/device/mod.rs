//! Devices: what the loop asks of one, hands without hardware, and those of this machine.
//!
//! [`attached`] finds and opens what this machine has: the HID devices of [`hid`] and, by their
//! makers' drivers, those of [`openhaptics`], [`force_dimension`] and [`haply`]. [`threaded`] makes
//! a device of two halves that block; [`conformance`] checks a device of your own. In a browser
//! there are only hands without hardware.

#[cfg(not(target_family = "wasm"))]
pub mod attached;
pub mod conformance;
pub(crate) mod contract;
#[cfg(not(target_family = "wasm"))]
mod driver;
#[cfg(not(target_family = "wasm"))]
pub mod force_dimension;
#[cfg(not(target_family = "wasm"))]
pub mod haply;
pub mod hid;
pub mod info;
#[cfg(not(target_family = "wasm"))]
pub mod openhaptics;
pub(crate) mod remote;
pub(crate) mod script;
pub(crate) mod simulated;
pub mod text;
#[cfg_attr(
    target_family = "wasm",
    allow(dead_code, reason = "makers' drivers use it")
)]
pub mod threaded;
pub(crate) mod timed_path;
pub(crate) mod workspace;
