//! Docking: the best poses of a pair over many rotations and all translations of a window, and what
//! the energy looks like around one.

pub(crate) mod descend;
pub(crate) mod docking;
pub(crate) mod error;
pub(crate) mod lattices;
pub(crate) mod options;
pub(crate) mod peaks;
pub(crate) mod refine;
pub(crate) mod rotations;
pub(crate) mod search;
mod state;

pub use descend::{CLOSE, SearchStage};
pub use error::StateError;
pub use options::DOCKING_RATIO;
