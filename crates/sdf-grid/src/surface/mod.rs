//! The boundary of a part as distances and integrals see it: flat faces and a tree over them.

pub(crate) mod bvh;
pub(crate) mod coplanar;
pub(crate) mod face;
pub(crate) mod inscribed_sphere;
pub(crate) mod interference;
pub(crate) mod moments;
