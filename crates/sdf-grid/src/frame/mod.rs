//! Directions that a part itself suggests: its principal axes, its symmetries, its smallest box.

pub(crate) mod minimum_box;
mod principal_axes;
pub(crate) mod symmetry;
