//! One-sided densities of a part, fitted in the cells of an octree.

mod build;
mod contour;
pub(crate) mod fit;
pub(crate) mod octree;
pub(crate) mod one_sided;
mod outline;
pub(crate) mod sharp;
