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

mod alone;
mod cluster;
pub(super) mod density;
pub(super) mod distance;
mod edge;
mod facet;
mod glance;
mod groups;
mod kernel;
pub(super) mod lanes;
mod near;
pub(super) mod points;
mod query;
mod seen;
mod settings;
#[cfg(test)]
mod tests;
mod together;
mod tree;
mod twins;
mod waiting;
pub(super) mod walk;
