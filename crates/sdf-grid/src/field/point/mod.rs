//! The density at single points, in f64.
//!
//! - [`edge_integral`]: the exact reduction of a flat face to integrals along its edges;
//! - [`density`]: the density through the tree, and on the boundary, where it jumps;
//! - [`reference`]: by brute force over all triangles, against which everything else is tested.

pub(crate) mod density;
pub(super) mod edge_integral;
pub(crate) mod reference;
