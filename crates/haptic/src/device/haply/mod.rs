//! Haply Inverse3 with or without a VerseGrip, by Haply's Inverse Service 3.1 or later.
//!
//! The service answers every message of its WebSocket on this machine with one that has the state
//! of all devices; a force holds until the next message. Its frame is ours, x right, y away from
//! the user, z up, in metres and newtons; its origin lies at the device's plate, so poses here are
//! shifted by [`CENTRE`]. The grip, if there is one, gives rotation and buttons.

mod look;
mod message;
mod opened;
mod options;
mod servo;
mod socket;
mod timed;

pub use look::{find, open};
pub use opened::CENTRE;
pub use options::InverseOptions;
