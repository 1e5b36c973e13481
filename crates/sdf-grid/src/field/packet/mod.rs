//! The tree code on packets of sixteen points, in single precision through SIMD.
//!
//! Positions are normalized ([`crate::Bvh`]). Everything is taken relative to the packet's
//! centre, subtracted in f64, so that single precision resolves lengths relative to the packet,
//! not to the part. Instruction sets are chosen at run time.
//!
//! - [`lanes`], [`points`]: packets; [`facet`]: faces and nodes as a packet sees them;
//! - [`distance`]: the nearest distance;
//! - [`settings`], [`kernel`]: what a tolerance means, and the kernel in single precision;
//! - [`cluster`], [`groups`], [`twins`]: far fields of clusters, the tree in groups, common edges;
//! - [`tree`]: all that together;
//! - [`query`], [`edge`], [`near`]: near faces by their edges; [`seen`], [`glance`]: far clusters;
//! - [`walk`]: the walk over the tree, for [`together`] sixteen points and for one [`alone`], whose
//!   clusters are [`waiting`];
//! - [`density`]: the way in.

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
