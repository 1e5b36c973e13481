//! A docked pair, or a tree of parts, with the joints that contact leaves, written for other programs:
//! URDF, MJCF, mates for CAD; and GLB for viewers.
//!
//! The moving part lies at the docked pose where all joint positions are zero; limits count from there.

mod error;
mod files;
mod glb;
mod inertia;
mod mates;
mod mjcf;
mod motion;
mod overlap;
mod pair;
mod tree;
mod urdf;
mod xml;

pub use error::ExportError;
pub use glb::{GlbPart, write_glb};
pub use mates::{
    JointRecord, MateKind, MateRecord, MateSide, Mates, PartRecord, PoseRecord, TravelRecord,
    mates, write_mates,
};
pub use mjcf::{write_mjcf, write_tree_mjcf};
pub use pair::DockedPair;
pub use tree::{JointedPart, PartTree};
pub use urdf::{write_tree_urdf, write_urdf};
