//! Why docking cannot start or go on.

use sdf_grid::{DensityError, LatticeError};

use crate::correlate::CorrelateError;
use crate::direct::evaluator::DirectError;
use crate::dock::error::SearchError;
use crate::pair::builder::PairBuildError;
use crate::pair::fields::PairError;
use crate::rotations::domain::RotationError;
use crate::setup::energy_scale::EnergyScaleError;

/// Why docking cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum DockingError {
    /// A pair cannot be had.
    #[error(transparent)]
    Build(PairBuildError),
    /// The energy scale cannot be had.
    #[error(transparent)]
    Energy(#[from] EnergyScaleError),
    /// The rotations to look at are out of range.
    #[error("rotations: {0}")]
    Rotations(#[from] RotationError),
    /// The translations to look at do not make a window.
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
    /// The search.
    #[error(transparent)]
    Search(SearchError),
    /// The model is out of range for the pair.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The clearance of mating faces is none.
    #[error("mating clearance: expected 0 m or more, found {found}")]
    MatingClearance {
        /// What was given, metres.
        found: f64,
    },
    /// The monitor asked to stop before anything was found.
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

impl From<SearchError> for DockingError {
    fn from(error: SearchError) -> Self {
        match error {
            SearchError::Cancelled => Self::Cancelled,
            other => Self::Search(other),
        }
    }
}
