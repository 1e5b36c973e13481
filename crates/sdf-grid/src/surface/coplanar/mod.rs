//! The same surface in fewer, better faces: coplanar triangles merged, long faces cut.
//!
//! Every query of a field is an integral over the surface or a distance from it, so any division into
//! flat faces gives the same result. Edges between coplanar triangles cost time and cancel. So each
//! planar region is outlined, corners on straight sides are dropped, and the region is triangulated
//! anew, triangles joined in pairs to quadrangles, unless its three or four corners already form a
//! convex face. Long faces are then cut across, so that clusters of them are compact.
//!
//! Files round coordinates, so the caller chooses the tolerance of coplanarity; the surface moves by
//! at most that much.

pub(crate) mod outline;
pub(crate) mod pieces;
mod regions;
