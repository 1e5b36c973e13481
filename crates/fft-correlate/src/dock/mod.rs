//! Docking: the best poses of a pair over many rotations and all translations of a window, and what
//! the energy looks like around one.
//!
//! ```
//! use std::sync::Arc;
//!
//! use fft_correlate::{Docking, DockingRequest, PairBuilder, PairSetup, Pose};
//! use sdf_grid::{Silent, shapes::PegInHole};
//!
//! let (hole, peg) = PegInHole::Rectangular.pair(1e-4)?;
//! let setup = PairSetup {
//!     builder: PairBuilder { spacing: Some(0.004), ..PairBuilder::default() },
//!     ..PairSetup::new(Arc::new(hole), Arc::new(peg))
//! };
//! // Only within 5 mm and 0.2 rad of a pose of the fixed part's frame.
//! let near = Some((Pose::IDENTITY, 0.005, 0.2));
//! let request = DockingRequest { top: 1, near, contact_only: true, ..DockingRequest::default() };
//! let result = Docking::new(&setup, request).run(&Silent)?;
//! // In the middle of the hole, within the clearance of 0.1 mm.
//! let best = &result.poses[0];
//! assert!(best.found.pose.translation.truncate().length() < 2e-4);
//! assert!(best.interference.depth < 1e-4 && best.rank > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
