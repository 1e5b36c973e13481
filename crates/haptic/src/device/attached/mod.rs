//! The devices of this machine, of every kind.

mod look;
mod open;

pub use look::{Missing, Survey, survey};
pub use open::open;
