//! The contact sum in single precision, for sixteen samples at a time.
//!
//! One surface is sampled, the other is divided into flat and curved patches; the kernel's integral
//! over the patches is known in closed form and summed over the samples. From the bottom up:
//!
//! - [`kernel`]: the kernel over a plane, and vector arithmetic;
//! - [`curved`]: osculating tori, cylinders, and coordinates developed into a plane;
//! - [`polylines`]: chains of edges and their simplification;
//! - [`regions`]: smooth parts, flat and curved regions of a surface;
//! - [`sampling`]: samples of a surface;
//! - [`lookup`]: grids, a lower bound on distance, and samples in clusters;
//! - [`patches`]: the patches visible from each cell of a grid;
//! - [`boundary_edges`], [`patch_integral`]: the integral over a patch and its boundary;
//! - [`contact_sum`]: the whole sum.

mod boundary_edges;
pub(crate) mod contact_sum;
mod curved;
mod kernel;
mod lookup;
mod patch_integral;
mod patches;
mod polylines;
mod regions;
mod sampling;
#[cfg(test)]
mod tests;
