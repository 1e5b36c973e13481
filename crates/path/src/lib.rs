//! Insertion paths: how a part gets to where it fits, or a proof that it cannot.
//!
//! [`PathSearch`] searches from the goal outwards: the part slides along its contacts, without friction,
//! in every direction that the walls leave, best first, until it lies beside the fixed part. The allowed
//! penetration rises until a path exists. The path is then shortened to few screw motions, moved away
//! from the walls, lowered in energy where it climbs, and measured.
//! [`DisassemblySearch`] does so with the parts and groups of an assembly, one after the other.
//!
//! ```
//! use std::sync::Arc;
//!
//! use fft_correlate::Pose;
//! use pegfit_path::{Outcome, PathRequest, PathSearch};
//! use sdf_grid::{Silent, shapes::PegInHole};
//!
//! let (hole, peg) = PegInHole::Rectangular.pair(2e-4)?;
//! let search = PathSearch::new(Arc::new(hole), Arc::new(peg), PathRequest::default())?;
//! let result = search.find(&Pose::IDENTITY, None, &Silent)?;
//! assert_eq!(result.outcome, Outcome::Free);
//! // Along the hole.
//! assert!(result.motions.iter().all(|motion| motion.axis[2].abs() > 0.99));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod collision;
mod disassembly;
mod error;
mod motion;
mod penetration_levels;
mod planner;
mod request;
mod result;
mod search;
mod shortcut;
mod smooth;

pub use disassembly::{
    AssemblyPart, DisassemblyRequest, DisassemblyResult, DisassemblySearch, DisassemblyStep,
    DisassemblyTries, LockedParts,
};
pub use error::PathError;
pub use motion::describe::Motion;
pub use planner::PathSearch;
pub use request::{PathRequest, Start};
pub use result::{Effort, EnergyBarrier, OtherPath, Outcome, PathPose, PathResult};
pub use search::visited::VisitedPoses;
