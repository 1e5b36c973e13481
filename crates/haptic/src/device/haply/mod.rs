//! Haply Inverse3 with or without a VerseGrip, by Haply's Inverse Service 3.1 or later.
//!
//! The service answers every message of its WebSocket on this machine with one that has the state
//! of all devices; a force holds until the next message. Its frame is ours, x right, y away from
//! the user, z up, in metres and newtons; its origin lies at the device's plate, so poses here are
//! shifted by [`CENTRE`]. The grip, if there is one, gives rotation and buttons.

mod device;
mod message;
mod socket;

pub use device::{CENTRE, InverseOptions, find, open};
