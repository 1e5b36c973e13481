//! The same surface in fewer, better faces: coplanar triangles merged, long faces cut.
//!
//! Every query of a field is an integral over the surface or a distance from it, so any flat pieces
//! will do. Edges between coplanar triangles cost time and cancel: each flat region is outlined
//! afresh, corners on straight sides are dropped, and unless three or four make a convex face it is
//! cut into triangles that are joined to quadrangles in pairs. Long faces are then cut across, so
//! that clusters of them are compact.
//!
//! Files round coordinates, so the caller says how far from flat is flat; the surface moves by that
//! much.

pub(crate) mod outline;
pub(crate) mod pieces;
mod regions;
