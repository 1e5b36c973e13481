//! Ways in: how a part gets to where it fits, or that it does not.
//!
//! [`PathSearch`] goes out of the fit: the part slides along what it touches, without friction, in every
//! direction that the walls leave, best first, until it lies beside the fixed part. What it may overlap
//! on the way is raised like water until a way opens. The way is then straightened into few screw
//! motions, taken off the walls, let down the energy where it climbs, and measured.
//! [`DisassemblySearch`] does so with the parts and groups of an assembly, one after the other.
//!
//! ```
//! use std::sync::Arc;
//!
//! use fft_correlate::Pose;
//! use pegfit_path::{Outcome, PathOptions, PathSearch};
//! use sdf_grid::Silent;
//!
//! let (groove, slider) = pegfit_fixtures::dovetail(2e-4)?;
//! let search = PathSearch::new(Arc::new(groove), Arc::new(slider), PathOptions::default())?;
//! let answer = search.find(&Pose::IDENTITY, None, &Silent)?;
//! assert_eq!(answer.outcome, Outcome::Free);
//! // Along the groove, 16 mm and more; out at the other end is as good.
//! assert!(answer.motions.len() == 1 && answer.motions[0].advance > 0.016);
//! assert!(answer.motions[0].axis[2].abs() > 0.999);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod answer;
mod contact;
mod disassembly;
mod error;
mod motion;
mod planner;
mod search;
mod way;

pub use answer::{Effort, OtherPath, Outcome, PathAnswer, PathPose};
pub use disassembly::options::DisassemblyOptions;
pub use disassembly::search::{
    AssemblyPart, Disassembly, DisassemblySearch, DisassemblyStep, LockedParts,
};
pub use disassembly::tries::DisassemblyTries;
pub use error::PathError;
pub use motion::words::Motion;
pub use planner::options::{PathOptions, Start};
pub use planner::plan::PathSearch;
pub use search::explored::Explored;
pub use way::climb::Climb;
