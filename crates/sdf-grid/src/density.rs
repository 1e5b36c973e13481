//! The complex skeletal density of a mesh on a lattice.

use ndarray::Array3;
use num_complex::Complex32;
use serde::{Deserialize, Serialize};

use crate::{DensityKernel, Lattice, Monitor, TriangleMesh};

/// How a lattice value represents the density around its node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The value at the node.
    Point,
    /// The mean over the node's cubic cell.
    CellAverage,
}

/// How accurate a field must be and how it is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityOptions {
    /// Relative L2 error against the f64 reference that the field must meet, 1e-5 .. 1e-2.
    pub tolerance: f64,
    /// How a lattice value represents its cell.
    pub sampling: Sampling,
    /// Distance outside the part, metres, at which the exterior density has faded to zero
    /// (smooth cut-off from 70 % of it); infinite for none.
    pub halo: f64,
}

/// The density of one part on a lattice, as two unit parts: `rho = l1 * exterior + l2 * interior`.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityField {
    /// Where the values sit, in the part's own frame.
    pub lattice: Lattice,
    /// Unit exterior density `O` (dimensionless), zero inside the part; includes the halo cut-off.
    pub exterior: Array3<Complex32>,
    /// Unit interior density `I` (dimensionless), zero outside the part.
    pub interior: Array3<Complex32>,
    /// Distance to the boundary at the node, metres, negative inside.
    pub signed_distance: Array3<f32>,
    /// Kernel thickness the field was computed with.
    pub sigma: f64,
    /// Halo the field was computed with, metres.
    pub halo: f64,
    /// How values represent cells.
    pub sampling: Sampling,
    /// [`TriangleMesh::hash`] of the part.
    pub mesh_hash: [u8; 32],
}

/// Why a field cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum DensityError {
    /// The caller's monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl DensityField {
    /// Computes the density of `mesh` at every node of `lattice` (eq_3, exact edge-integral form).
    ///
    /// # Errors
    /// If an option is out of range or the monitor cancels.
    pub fn compute(
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        lattice: &Lattice,
        options: &DensityOptions,
        monitor: &dyn Monitor,
    ) -> Result<Self, DensityError> {
        let _ = (mesh, kernel, lattice, options, monitor);
        todo!()
    }
}
