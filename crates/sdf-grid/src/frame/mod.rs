//! Directions that a part itself suggests: its principal axes, its symmetries, its snuggest box.

mod principal_axes;
pub(crate) mod snug;
pub mod symmetry;
