//! A docked pair with the joint that contact leaves, written for other programs: URDF, MJCF, and mates
//! for CAD.
//!
//! The moving part lies at the docked pose where all joint positions are zero; limits count from there.

mod error;
mod files;
mod inertia;
mod mates;
mod mjcf;
mod motion;
mod overlap;
mod pair;
mod urdf;
mod xml;

pub use error::ExportError;
pub use mates::{
    JointRecord, MateKind, MateRecord, MateSide, Mates, PartRecord, PoseRecord, TravelRecord,
    mates, write_mates,
};
pub use mjcf::write_mjcf;
pub use pair::DockedPair;
pub use urdf::write_urdf;
