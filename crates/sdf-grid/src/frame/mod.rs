//! Frames of a part: principal axes, symmetry axes, smallest box.

pub(crate) mod minimum_box;
mod principal_axes;
pub(crate) mod symmetry;
