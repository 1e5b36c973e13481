//! The density at single points, in f64.
//!
//! - [`edge_integral`]: the exact reduction of a flat face to integrals along its edges;
//! - [`edge_gradient`], [`distance_gradient`]: gradients of those, and of the distance;
//! - [`unit`]: what comes out at a point;
//! - [`boundary`]: points on the boundary, where the density jumps;
//! - [`tree`]: the density through the hierarchy;
//! - [`gradient`]: its gradient through the hierarchy;
//! - [`reference`]: both by brute force over all triangles, the measure of everything else.

pub(super) mod boundary;
mod distance_gradient;
mod edge_gradient;
pub(super) mod edge_integral;
pub(crate) mod gradient;
pub(crate) mod reference;
pub(super) mod tree;
pub(crate) mod unit;
