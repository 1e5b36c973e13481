//! The energy well about a pose in numbers.

pub(crate) mod analysis;
pub(crate) mod error;
mod peak;
mod scan;

pub use peak::peak_force;
pub use scan::{Axis, AxisSide, Barrier};
