//! Why a pair has no truth.

use fft_correlate::ModelError;
use sdf_grid::{DensityError, KernelError};

/// Why two meshes do not make a [`crate::Truth`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TruthError {
    /// A parameter of the model is out of range.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The kernel thickness is out of range.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// A part has no surface.
    #[error(transparent)]
    Density(#[from] DensityError),
    /// An option is out of range.
    #[error("truth option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
}
