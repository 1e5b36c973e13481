//! Triangle meshes: what they are, how they are cleaned, shapes made from numbers.

pub(crate) mod aabb;
pub(crate) mod boolean;
pub(crate) mod error;
pub(crate) mod hygiene;
pub(crate) mod measure;
pub(crate) mod polygon;
pub mod shapes;
pub(crate) mod triangle_mesh;
