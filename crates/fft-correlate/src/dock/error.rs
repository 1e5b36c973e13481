//! Why a search cannot start or go on.

use std::path::PathBuf;

use glam::{DQuat, DVec3};
use sdf_grid::LatticeError;
use sdf_grid::recipe::Difference;

use crate::correlate::CorrelateError;
use crate::direct::evaluator::DirectError;
use crate::pair::fields::PairError;

/// Why a search cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// The correlator cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
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
    #[error("translations to search: {0}")]
    Window(#[from] LatticeError),
    /// The docking weights are out of range.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A pair has no direct evaluator.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The state file.
    #[error(transparent)]
    State(#[from] StateError),
    /// Two pairs are not of the same parts.
    #[error("the pairs of a search must have one pivot, found {coarse} and {other}")]
    Pivots {
        /// The coarse pair's, metres.
        coarse: DVec3,
        /// Another pair's, metres.
        other: DVec3,
    },
    /// The monitor cancelled before any rotation was scored.
    #[error("cancelled")]
    Cancelled,
}

/// Why a search cannot go on from its file, or write it.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not a search's state.
    #[error("{path}: not the state of a docking search: {reason}", path = path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The file belongs to another search.
    #[error(
        "{}: state of another search: {} is {} there, {} here; delete it to start anew",
        path.display(), difference.key, difference.stored, difference.given
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// What differs first.
        difference: Difference,
    },
}
