//! The tree code on packets of sixteen points, in single precision through SIMD.
//!
//! Positions are normalized ([`crate::Bvh`]). All positions are relative to the packet's centre,
//! subtracted in f64, so that single precision resolves lengths relative to the packet, not to the
//! part. Instruction sets are chosen at run time. From the bottom up:
//!
//! - [`points`]: packets of points;
//! - [`distance`]: faces and nodes relative to a packet, and the nearest distance;
//! - [`accuracy`], [`kernel`]: parameters for a tolerance, and the kernel in single precision;
//! - [`shared_edges`], [`tree`]: edges that two faces share; wide nodes and their far fields;
//! - [`near_faces`]: edge integrals of near faces;
//! - [`acceptance`]: the acceptance test of far clusters, and their far fields;
//! - [`density`]: the traversal for sixteen points or for one, and the entry point.

mod acceptance;
mod accuracy;
pub(super) mod density;
pub(super) mod distance;
mod kernel;
mod near_faces;
pub(super) mod points;
mod shared_edges;
#[cfg(test)]
mod tests;
mod tree;
