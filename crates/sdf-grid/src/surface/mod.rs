//! The boundary of a part for distances and integrals: flat faces and a tree over them.

pub(crate) mod bvh;
pub(crate) mod coplanar;
pub(crate) mod face;
pub(crate) mod inscribed_sphere;
pub(crate) mod interference;
pub(crate) mod moments;
