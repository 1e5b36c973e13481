//! Docking: the best poses of a pair over many rotations and all translations of a window, and what
//! the energy looks like around one.

pub(crate) mod docking;
pub(crate) mod error;
pub(crate) mod grid_levels;
pub(crate) mod local_refinement;
pub(crate) mod options;
pub(crate) mod peaks;
pub(crate) mod refine;
pub(crate) mod search;
mod state;

pub use docking::{CONVINCING, EnergySearch, Ranking};
pub use grid_levels::GridLevels;
pub use local_refinement::{CLOSE, FoundPose, SearchStage};
pub use options::DOCKING_RATIO;
pub use options::DockingPlan;
