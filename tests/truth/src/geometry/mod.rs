//! Convex polygons and tetrahedra cut by planes.

pub(crate) mod facet;
pub(crate) mod plane;
pub(crate) mod polygon;
pub(crate) mod tetrahedron;
