//! The sum in double precision, face by face and edge by edge: what the fast one is held against.
//!
//! - [`kernel`]: the short-range kernel, integrated over planes;
//! - [`edge`]: what edges take from it;
//! - [`surface`]: one part's surface, as seen from a point;

mod edge;
mod kernel;
pub(crate) mod surface;
mod tests;
