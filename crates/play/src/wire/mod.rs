//! What goes over the wire, both ways, byte by byte.

pub(crate) mod frame;
pub(crate) mod mesh;
pub(crate) mod request;
