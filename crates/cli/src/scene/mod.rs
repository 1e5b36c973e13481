//! Scene files: the parts, how finely to compute, and how to feel them.
//!
//! A scene is TOML. Three lines suffice: the unit and the two meshes. Every key is described in
//! `docs/scene.md`.

mod assembly;
mod check;
mod check_parts;
mod fields;
mod parts;
mod raw;
mod read;
mod source;
#[cfg(test)]
mod tests;
mod types;
mod values;

pub use assembly::Assembly;
pub(crate) use fields::plan;
pub(crate) use parts::{hash_text, read_part};
pub use types::{
    EnergyScale, FitChoice, LatticeChoice, LatticeStep, Loading, Part, PlacedMesh, Scene,
    WindowChoice,
};
pub(crate) use values::quaternion;
