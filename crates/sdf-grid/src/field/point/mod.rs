//! The density at single points, in f64.
//!
//! - [`edge_integral`]: the exact reduction of a flat face to integrals along its edges;
//! - [`unit`]: the result at a point;
//! - [`boundary`]: points on the boundary, where the density jumps;
//! - [`tree`]: the density through the hierarchy;
//! - [`reference`]: by brute force over all triangles, the measure of everything else.

pub(super) mod boundary;
pub(super) mod edge_integral;
pub(crate) mod reference;
pub(crate) mod tree;
pub(crate) mod unit;
