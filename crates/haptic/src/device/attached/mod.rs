//! The devices of this machine, of every kind.

mod open;
mod survey;

pub use open::open;
pub use survey::{Missing, Survey, survey};
