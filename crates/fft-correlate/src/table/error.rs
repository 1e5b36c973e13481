//! Why a table cannot be made.

use crate::pair::model::ModelError;
use crate::rotations::domain::RotationError;

/// Why a table cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// A model parameter is out of range.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The rotations cannot be gridded.
    #[error(transparent)]
    Rotations(#[from] RotationError),
    /// A number of the specification is not finite or not a lattice's.
    #[error("table: {name} must be {expected}, found {found}")]
    Spec {
        /// Which.
        name: &'static str,
        /// What is accepted.
        expected: &'static str,
        /// What was given.
        found: String,
    },
    /// The energies do not fit.
    #[error(
        "table of {rotations} rotations x {displacements} displacements needs {needed} bytes, \
         {limit} are allowed"
    )]
    Memory {
        /// Rotation nodes.
        rotations: u64,
        /// Translation nodes of each rotation.
        displacements: u64,
        /// Bytes of energies.
        needed: u128,
        /// The limit, bytes.
        limit: u64,
    },
    /// A computed energy is not a finite number.
    #[error("energy of rotation node {row}, translation node {index:?} is {found}")]
    NotFinite {
        /// Rotation node.
        row: usize,
        /// Translation node.
        index: [usize; 3],
        /// The energy, joules.
        found: f32,
    },
    /// A coefficient is so much larger than those probed that half precision cannot hold it.
    #[error("coefficient of rotation node {row} is {found} J, beyond the representable {limit} J")]
    Overflow {
        /// Rotation node.
        row: usize,
        /// It, joules.
        found: f32,
        /// The largest that the table's unit can hold, joules.
        limit: f64,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
