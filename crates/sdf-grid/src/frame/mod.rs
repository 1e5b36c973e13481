//! Frames of a part: principal axes, symmetry axes, congruence, smallest box.

pub(crate) mod congruence;
mod matching;
pub(crate) mod minimum_box;
mod principal_axes;
pub(crate) mod symmetry;
