//! Why docking cannot start or go on.

use std::path::PathBuf;

use glam::{DQuat, DVec3};
use sdf_grid::provenance::Difference;
use sdf_grid::{DensityError, LatticeError};

use crate::correlate::support::CorrelateError;
use crate::direct::evaluator::DirectError;
use crate::pair::builder::PairBuildError;
use crate::pair::fields::PairError;
use crate::pair::setup::EnergyScaleError;
use crate::rotations::domain::RotationError;

/// Why docking cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum DockingError {
    /// A pair cannot be built.
    #[error(transparent)]
    Build(PairBuildError),
    /// The energy scale is out of range.
    #[error(transparent)]
    Energy(#[from] EnergyScaleError),
    /// The rotations are out of range.
    #[error("rotations: {0}")]
    Rotations(#[from] RotationError),
    /// No rotation was given.
    #[error("docking needs at least one rotation, found none")]
    NoRotations,
    /// A rotation is not a unit quaternion.
    #[error("rotation {index}: expected a unit quaternion, found {found}")]
    Rotation {
        /// Its place in the list.
        index: usize,
        /// What was given.
        found: DQuat,
    },
    /// The translations do not make a window.
    #[error("window: {0}")]
    Window(#[from] LatticeError),
    /// The correlation cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
    /// The correlation may not fit in memory.
    #[error("the correlation may need {needed} bytes, expected at most {limit}")]
    Memory {
        /// Bytes needed, at most.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The model is out of range for the pair.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// Two pairs are not of the same parts.
    #[error("the pairs of a search must have one pivot, found {coarse} and {other}")]
    Pivots {
        /// The coarse pair's, metres.
        coarse: DVec3,
        /// Another pair's, metres.
        other: DVec3,
    },
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The clearance of mating faces is negative or not finite.
    #[error("mating clearance: expected 0 m or more, found {found}")]
    MatingClearance {
        /// What was given, metres.
        found: f64,
    },
    /// The state file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    StateFile {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The state file is not a search's state.
    #[error("{path}: not the state of a docking search: {reason}", path = path.display())]
    StateFormat {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The state file belongs to another search.
    #[error(
        "{}: state of another search: {} is {} there, {} here; delete it to start anew",
        path.display(), difference.key, difference.stored, difference.given
    )]
    OtherState {
        /// The file.
        path: PathBuf,
        /// The first key that differs.
        difference: Difference,
    },
    /// What is known of the answer is of no use to a search by energy.
    #[error(
        "{known}: expected ranking by contact, without a state file or an exhaustive search, found \
         a search by energy, which does not know it"
    )]
    Unused {
        /// What is known: `near`, `axis` or `keep apart`.
        known: &'static str,
    },
    /// No face of one part meets a face of the other anywhere that was asked for.
    #[error(
        "no pose in which faces of the two parts meet: widen the window or the rotations, or leave \
         out what is known (near, axis, keep apart)"
    )]
    NothingMates,
    /// The monitor asked to stop before any rotation was scored.
    #[error("cancelled")]
    Cancelled,
}

impl From<PairBuildError> for DockingError {
    fn from(error: PairBuildError) -> Self {
        match error {
            PairBuildError::Density {
                source: DensityError::Cancelled,
                ..
            } => Self::Cancelled,
            other => Self::Build(other),
        }
    }
}
