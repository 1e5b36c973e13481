//! Complex skeletal density and signed distance of triangle meshes on a lattice.
//!
//! The crate name keeps the paper's abbreviation (skeletal density function); in the code the two
//! quantities are always called [`density`] and `signed_distance`.
//!
//! Lengths are metres. Formulas, signs and index order are fixed in `docs/conventions.md`.

pub mod atomic;
pub mod bvh;
mod coplanar;
pub mod density;
mod face;
pub mod field_cache;
pub mod hygiene;
pub mod kernel;
#[doc(hidden)]
pub mod large;
pub mod lattice;
pub mod mesh;
pub mod mesh_error;
pub mod mesh_io;
mod moments;
pub mod monitor;
mod polygon;
mod quadrature;
pub mod recipe;
pub mod shapes;
pub mod snug;
pub mod symmetry;
mod winding;

pub use bvh::{Bvh, Nearest};
pub use density::{
    DensityError, DensityField, DensityGradient, DensityOptions, FIELD_VERSION, FieldRecipe,
    ReferenceDensity, Sampling, UnitDensity, UnitGradient, signed_distances,
};
pub use field_cache::{CacheError, FieldCache};
pub use hygiene::{ComponentReport, HygieneOptions, HygieneReport};
pub use kernel::{DensityKernel, KernelError};
pub use lattice::{Lattice, LatticeError};
pub use mesh::{Aabb, TriangleMesh};
pub use mesh_error::MeshError;
pub use mesh_io::LengthUnit;
pub use monitor::{Monitor, Silent};
pub use snug::snug_rotation;
pub use symmetry::{SymmetryAxis, SymmetryOrder};
