//! Energies over a grid of rotations and a lattice of translations: made, stored, and interpolated.

pub(crate) mod accuracy;
pub(crate) mod bake;
mod encode;
pub(crate) mod energy_table;
pub(crate) mod launcher;
mod layout;
pub(crate) mod parts;
pub(crate) mod plan;
pub(crate) mod spec;
mod stencil;
pub(crate) mod store;

pub use accuracy::Errors;
pub use launcher::LauncherError;
pub use plan::{BakePlan, TableSetupError};
pub use store::metadata::FORMAT_VERSION;
pub use store::table_store::ChunkState;
