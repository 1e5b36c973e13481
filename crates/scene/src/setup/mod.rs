//! From a scene to what the libraries work on.

mod explain;
pub(crate) mod meshes;
pub(crate) mod placed_parts;
pub(crate) mod scene_setup;
pub(crate) mod tables;
pub(crate) mod warning;
