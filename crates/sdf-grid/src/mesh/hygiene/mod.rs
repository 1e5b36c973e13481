//! What every mesh goes through before anything is computed from it.
//!
//! In order: vertices must be finite and indices in range; vertices closer than a tolerance are
//! welded; faces without area and repeated faces are dropped; open edges are cut where the vertices
//! of others lie on them, so that faces which meet share vertices; the faces of each component are
//! oriented alike, then outwards (a cavity inwards); components that touch or cut through one another
//! become the surface of their union; what is still open is measured, and refused when it is too much. The result does not depend on the order of the input beyond the order of
//! its own vertices and triangles, and a second run changes nothing.

mod edges;
mod faces;
mod holes;
mod orient;
pub(crate) mod pipeline;
pub(crate) mod report;
mod stitch;
mod unite;
mod weld;
