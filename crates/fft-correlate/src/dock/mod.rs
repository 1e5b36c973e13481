//! Docking: the best poses of a pair over many rotations and all translations of a window, and what
//! the energy looks like around one.

pub(crate) mod decide;
mod descend;
pub(crate) mod docking;
pub(crate) mod docking_error;
pub(crate) mod domain;
pub(crate) mod error;
pub(crate) mod lattices;
mod measure;
pub(crate) mod options;
pub(crate) mod peaks;
pub(crate) mod plan;
mod recipe;
pub(crate) mod refine;
pub(crate) mod report;
pub(crate) mod rotations;
mod scan;
mod score;
pub(crate) mod search;
pub(crate) mod sketch;
mod slopes;
mod state;
pub(crate) mod told;
mod weights;

pub use error::StateError;
pub use report::{CLOSE, SearchStage};
pub use weights::DOCKING_RATIO;
