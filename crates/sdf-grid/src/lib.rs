//! Complex skeletal density and signed distance of triangle meshes on a lattice.
//!
//! The crate name keeps the paper's abbreviation (skeletal density function); in the code the two
//! quantities are always called density and signed distance: [`DensityField`] holds both.
//!
//! Lengths are metres. Formulas, signs and index order are fixed in `docs/conventions.md`.

// Without vectors the kernels for sixteen lanes take hours to compile.
#[cfg(all(target_family = "wasm", not(target_feature = "simd128")))]
compile_error!("WebAssembly needs 128-bit vectors: RUSTFLAGS=\"-C target-feature=+simd128\"");

mod contact;
mod field;
mod frame;
mod mating;
mod mesh;
pub mod mesh_io;
mod support;
mod surface;

pub use contact::error::ContactError;
pub use contact::sum::contact_sum::{ContactSum, ContactSums};
pub use field::cache::{CacheError, FieldCache};
pub use field::density_field::DensityField;
pub use field::kernel::{DensityKernel, KernelError};
pub use field::lattice::{Lattice, LatticeError};
pub use field::options::DensityError;
pub use field::options::{DensityOptions, Sampling};
pub use field::point::density::DensityProbe;
pub use field::point::density::UnitDensity;
pub use field::point::reference::ReferenceDensity;
pub use field::provenance::{FIELD_VERSION, FieldProvenance};
pub use field::sampling::signed_distance::signed_distances;
pub use frame::congruence::congruence;
pub use frame::minimum_box::minimum_box_rotation;
pub use frame::symmetry::{SymmetryAxis, SymmetryOrder};
pub use mating::enclosure::Enclosure;
pub use mating::face_grid::{FaceGrid, OppositeFace};
pub use mating::features::{PatchAxis, Plane, RoundPatch, SpherePatch, SurfaceFeatures};
pub use mating::matrix6::{Matrix6, Vector6};
pub use mating::surface_points::{SurfacePoint, surface_points};
pub use mesh::aabb::Aabb;
pub use mesh::error::MeshError;
pub use mesh::repair::report::{ComponentReport, RepairOptions, RepairReport};
pub use mesh::shapes;
pub use mesh::topology::{DisjointSets, Edge, HalfEdge, Topology};
pub use mesh::triangle_mesh::TriangleMesh;
pub use mesh_io::ledger::{Ledger, LedgerEntry, LedgerKind};
pub use mesh_io::unit::LengthUnit;
pub use support::monitor::{Monitor, Silent};
pub use support::place::require_unplanted;
pub use support::{atomic, growing, provenance, regular, text};
#[doc(hidden)]
pub use support::{large, level, prefetch};
pub use surface::bvh::tree::{Bvh, Nearest};
pub use surface::inscribed_sphere::inscribed_sphere_radius;
pub use surface::interference::{Interference, InterferenceQuery};

/// Rotational symmetry axes of a part.
pub mod symmetry {
    pub use crate::frame::symmetry::detect;
}
