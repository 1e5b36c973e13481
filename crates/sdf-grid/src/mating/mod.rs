//! How two surfaces lie against each other: points on one, faces of the other near them, and the
//! planes and axes by which parts are put together.

pub(crate) mod enclosure;
pub(crate) mod face_grid;
pub(crate) mod features;
pub(crate) mod matrix6;
pub(crate) mod surface_points;
