//! The density at single points, in f64.
//!
//! - [`edge_integral`]: the exact reduction of a flat face to integrals along its edges, and the density
//!   of a point;
//! - [`tree`]: the density through the hierarchy, and on the boundary, where it jumps;
//! - [`reference`]: by brute force over all triangles, the measure of everything else.

pub(crate) mod edge_integral;
pub(crate) mod reference;
pub(crate) mod tree;
