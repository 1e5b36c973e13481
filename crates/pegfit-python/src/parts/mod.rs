//! Meshes and their densities.

pub(crate) mod density;
pub(crate) mod mesh;
