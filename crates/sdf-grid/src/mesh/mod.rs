//! Triangle meshes: what they are, how they are repaired, how their faces meet, shapes made from numbers.

pub(crate) mod aabb;
pub(crate) mod boolean;
pub(crate) mod decimation;
pub(crate) mod error;
pub(crate) mod measure;
pub(crate) mod polygon;
pub(crate) mod repair;
pub mod shapes;
pub(crate) mod topology;
pub(crate) mod triangle_mesh;
