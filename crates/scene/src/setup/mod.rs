//! From a scene to what the libraries work on.

mod errors;
pub(crate) mod parts;
pub(crate) mod scene_setup;
pub(crate) mod tables;
