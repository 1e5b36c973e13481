//! From a file of many solids, or a robot's description, to a scene.

pub(crate) mod draft;
mod element;
pub(crate) mod error;
mod geometry;
pub(crate) mod mjcf;
pub(crate) mod solid_set;
mod urdf;
pub(crate) mod write;
