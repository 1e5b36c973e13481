//! USB HID PID devices (Physical Interface Device class 1.0): force feedback on their axes.
//!
//! Ids, sizes and ranges of all reports come from the device's own descriptor. Each axis gets one
//! constant-force effect of unlimited duration, started once; a force is then one short report per
//! axis that changed. Setting up, in this order: device control reset and actuators on, device
//! gain, pool asked for, and per axis create new effect, block load, set effect. At the end: every
//! magnitude zero, stop all, blocks freed.

mod device;
pub(crate) mod layout;
pub(crate) mod settings;
mod usage;

pub use device::open;
pub use layout::{BlockLoad, PidLayout, Pool};
pub use settings::PidSettings;
