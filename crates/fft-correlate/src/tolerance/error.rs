//! Why nothing meets a tolerance.

use std::fmt;

use crate::direct::evaluator::DirectError;
use crate::direct::tiles::TileError;
use crate::pair::builder::PairBuildError;
use crate::pair::setup::PairSetupError;
use crate::table::plan::TablePlanError;
use crate::table::spec::TableError;

/// Why there is nothing finer than the best that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Limit {
    /// As many spacings as are tried.
    Spacings {
        /// The best, metres.
        best: f64,
    },
    /// The pair on half the next spacing does not fit in memory.
    LatticeMemory {
        /// The best, metres.
        best: f64,
        /// The next, metres.
        next: f64,
        /// `the density fields` or `the correlation`.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// As many rotation steps as are tried.
    Steps {
        /// The best, degrees.
        best: f64,
    },
    /// The table with the next rotation step does not fit in memory.
    TableMemory {
        /// The best, degrees.
        best: f64,
        /// The next, degrees.
        next: f64,
        /// Bytes needed; none if it had more nodes than any table may have.
        needed: Option<u128>,
        /// Bytes allowed.
        limit: u64,
    },
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spacings { best } => write!(f, "the finest spacing tried is {best} m"),
            Self::LatticeMemory {
                best,
                next,
                what,
                needed,
                limit,
            } => write!(
                f,
                "at a spacing of {best} m; for {next} m, {what} would need {needed} bytes of {limit}"
            ),
            Self::Steps { best } => write!(f, "the finest rotation step tried is {best} degrees"),
            Self::TableMemory {
                best,
                next,
                needed: Some(needed),
                limit,
            } => write!(
                f,
                "at a rotation step of {best} degrees; {next} would need {needed} bytes of {limit}"
            ),
            Self::TableMemory { best, next, .. } => write!(
                f,
                "at a rotation step of {best} degrees; {next} is more than any table may have"
            ),
        }
    }
}

/// Why nothing was chosen.
#[derive(Debug, thiserror::Error)]
pub enum ToleranceError {
    /// None that was tried meets the tolerance.
    #[error(
        "errors of force and torque of {asked} of the rms asked for, {reached} reached: {limit}"
    )]
    Missed {
        /// Share of the rms of force and torque.
        asked: f64,
        /// The least share found.
        reached: f64,
        /// Where it was found, and why there is no finer one.
        limit: Limit,
    },
    /// A pair cannot be had.
    #[error(transparent)]
    Pair(PairSetupError),
    /// A pair has no such table.
    #[error(transparent)]
    Plan(#[from] TablePlanError),
    /// A probe cannot be computed.
    #[error(transparent)]
    Table(TableError),
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The system starts no threads.
    #[error(transparent)]
    Threads(TileError),
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<TileError> for ToleranceError {
    fn from(error: TileError) -> Self {
        match error {
            TileError::Setup(e) => e.into(),
            TileError::Direct(e) => e.into(),
            TileError::Threads { .. } => Self::Threads(error),
        }
    }
}

impl From<PairSetupError> for ToleranceError {
    fn from(error: PairSetupError) -> Self {
        match error {
            PairSetupError::Cancelled => Self::Cancelled,
            other => Self::Pair(other),
        }
    }
}

impl From<TableError> for ToleranceError {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Cancelled => Self::Cancelled,
            other => Self::Table(other),
        }
    }
}

impl ToleranceError {
    /// The computation that did not fit in memory, its need and the limit, bytes.
    pub(super) fn memory(&self) -> Option<(&'static str, u64, u64)> {
        match *self {
            Self::Pair(PairSetupError::Build(PairBuildError::Memory { needed, limit, .. })) => {
                Some(("the density fields", needed, limit))
            }
            Self::Plan(TablePlanError::Memory { needed, limit }) => {
                Some(("the correlation", needed, limit))
            }
            _ => None,
        }
    }
}
