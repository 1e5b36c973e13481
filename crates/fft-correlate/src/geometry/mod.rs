//! Rigid motions, placements, windows of displacements, half turns, and interpolation along
//! lattice axes.

pub(crate) mod half_turn;
pub(crate) mod placement;
pub(crate) mod pose_spacing;
pub(crate) mod se3;
pub(crate) mod side;
pub(crate) mod taps;
pub(crate) mod translation;
