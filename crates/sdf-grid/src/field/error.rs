//! Why a field cannot be computed.

/// Why a field cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DensityError {
    /// The caller's monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// An option is out of its range.
    #[error("density option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The mesh has no triangle with an area.
    #[error("a density needs a mesh with at least one triangle of non-zero area, found none")]
    EmptyMesh,
    /// The field's arrays cannot be allocated.
    #[error("density field needs {bytes} bytes of memory, which cannot be had")]
    Memory {
        /// What the field needs.
        bytes: u64,
    },
}
