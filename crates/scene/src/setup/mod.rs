//! A scene's meshes, pairs and tables, prepared for the libraries.

mod errors;
pub(crate) mod parts;
pub(crate) mod scene_setup;
pub(crate) mod tables;
