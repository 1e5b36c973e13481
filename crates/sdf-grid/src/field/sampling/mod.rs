//! From points to lattice values.
//!
//! - [`blocks`]: arrays divided into blocks, the unit of work, and patches of points into packets;
//! - [`sign_propagation`]: on which side of the boundary the points of a patch lie;
//! - [`adaptive_interpolation`]: blocks that are interpolated from some of their points;
//! - [`patch_density`]: distances, signs and densities of a patch;
//! - [`upsampling`]: a fine lattice interpolated from one of twice its spacing;
//! - [`gaussian_smoothing`]: fields smoothed by a Gaussian;
//! - [`fill`]: the values of a field, with halo and cell averages;
//! - [`signed_distance`]: distances alone.

mod adaptive_interpolation;
pub(super) mod blocks;
pub(super) mod fill;
mod gaussian_smoothing;
mod patch_density;
mod sign_propagation;
pub(crate) mod signed_distance;
mod upsampling;
