//! The integral of the product of two parts' densities over space.

mod blend;
mod cell;
mod pieces;
mod sums;
mod surface;
pub(crate) mod truth;
mod walk;
