//! Scene files: the parts, how finely to compute, and how to feel them.
//!
//! A scene is TOML. Three lines suffice: the unit and the two meshes. Every key is described in
//! `docs/scene.md`.

mod assembly;
mod check;
mod check_parts;
mod parts;
mod raw;
mod read;
mod setup;
mod source;
#[cfg(test)]
mod tests;
mod types;
mod values;

pub use assembly::Assembly;
pub(crate) use assembly::explain_design;
pub(crate) use parts::read_part;
pub(crate) use setup::{display_unit, explain, explain_build, put, rotations, setup, setup_of};
pub use types::{FitChoice, LatticeChoice, Loading, Part, PlacedMesh, Scene, WindowChoice};
pub(crate) use values::quaternion;
