//! The density at single points, in f64.
//!
//! - [`edge_integral`]: the exact reduction of a flat face to integrals along its edges;
//! - [`unit`]: the result at a point;
//! - [`tree`]: the density through the hierarchy, and on the boundary, where it jumps;
//! - [`reference`]: by brute force over all triangles, the measure of everything else.

pub(crate) mod density;
pub(super) mod edge_integral;
pub(crate) mod reference;
