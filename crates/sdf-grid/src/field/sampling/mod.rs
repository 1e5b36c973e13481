//! From points to lattice values.
//!
//! - [`patch`]: small regular patches of points, cut into packets;
//! - [`signs`]: on which side of the boundary their points lie;
//! - [`smooth`]: blocks that are interpolated from some of their points;
//! - [`patch_density`]: distances, signs and densities of a patch;
//! - [`blocks`]: arrays cut into blocks, the unit of work;
//! - [`smoothed`]: fields smoothed by a Gaussian, [`upsampling`] where they need no fine lattice;
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
