//! Energies over a grid of rotations and a lattice of translations: made, stored, and interpolated.

pub(crate) mod accuracy;
mod as_baked;
pub(crate) mod bake;
pub(crate) mod design;
mod encode;
pub(crate) mod energy_table;
pub(crate) mod error;
mod fade;
pub(crate) mod launcher;
mod layout;
pub(crate) mod parts;
mod plan;
mod query;
mod rows;
pub(crate) mod spec;
mod stencil;
pub(crate) mod storage;
pub(crate) mod store;

pub use accuracy::Errors;
pub use as_baked::TableSetupError;
pub use launcher::LauncherError;
pub use store::chunks::ChunkState;
pub use store::format::FORMAT_VERSION;
