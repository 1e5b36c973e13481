//! The complex skeletal density of a mesh on a lattice.
//!
//! - [`reference`]: brute force over all triangles in f64, the measure of everything else;
//! - `edge_integral`: the exact reduction of a flat face to integrals along its edges;
//! - `gradient`: the gradient at single points (`edge_gradient` of a face, `distance_gradient` on the
//!   medial axis);
//! - `point`: the tree code at single points in f64;
//! - `fast`: the tree code on packets of sixteen points in f32;
//! - `patch`: distances, signs and densities of a small regular patch;
//! - `smooth`: blocks of a patch that are interpolated from some of their points;
//! - `signs`: on which side of the boundary points lie;
//! - `signed_distance`: distances alone;
//! - `recipe`: everything that a field's values depend on;
//! - `sampling`: from points to lattice values (blocks, halo, cell averages).

mod boundary;
mod distance_gradient;
mod edge_gradient;
mod edge_integral;
mod fast;
mod gradient;
mod patch;
mod point;
mod recipe;
pub mod reference;
mod sampling;
mod signed_distance;
mod signs;
mod smooth;

use bytemuck::Zeroable;
use ndarray::{Array3, Zip};
use num_complex::Complex32;
use serde::{Deserialize, Serialize};

use crate::{DensityKernel, Lattice, Monitor, TriangleMesh, large};
pub use gradient::{DensityGradient, UnitGradient};
pub use recipe::{FIELD_VERSION, FieldRecipe};
pub use reference::{ReferenceDensity, UnitDensity};
pub use signed_distance::signed_distances;

/// How a lattice value represents the density around its node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The value at the node.
    Point,
    /// The mean over the node's cubic cell, by 4 x 4 x 4 sub-points in the cells that the boundary
    /// may cut; the value at the node elsewhere. Exterior and interior are averaged separately, so
    /// in a cut cell both are non-zero.
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

impl Default for DensityOptions {
    /// Tolerance 1e-3, cell averages, no halo.
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            sampling: Sampling::CellAverage,
            halo: f64::INFINITY,
        }
    }
}

impl DensityOptions {
    /// Checks every option against its range.
    ///
    /// # Errors
    /// Names the first option out of range.
    pub fn validate(&self) -> Result<(), DensityError> {
        let refuse = |name, expected, found| DensityError::Option {
            name,
            expected,
            found,
        };
        if !(1e-5..=1e-2).contains(&self.tolerance) {
            return Err(refuse("tolerance", "in 1e-5..=1e-2", self.tolerance));
        }
        if self.halo.is_nan() || self.halo <= 0.0 {
            return Err(refuse("halo", "> 0 metres", self.halo));
        }
        Ok(())
    }
}

/// The density of one part on a lattice, as two unit parts: `rho = l1 * exterior + l2 * interior`.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityField {
    /// Unit exterior density `O` (dimensionless), zero inside the part; includes the halo cut-off.
    pub exterior: Array3<Complex32>,
    /// Unit interior density `I` (dimensionless), zero outside the part.
    pub interior: Array3<Complex32>,
    /// Distance to the boundary at the node, metres, negative inside.
    pub signed_distance: Array3<f32>,
    /// What the values depend on.
    pub recipe: FieldRecipe,
}

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
        /// What the field needs, see [`DensityField::memory_bytes`].
        bytes: u64,
    },
}

impl DensityField {
    /// Computes the density of `mesh` at every node of `lattice` (eq_3, exact edge-integral form)
    /// on rayon's current thread pool. The result does not depend on the number of threads.
    ///
    /// On the boundary itself the density is the mean of its limits from both sides: the exterior
    /// part holds half the outer limit, the interior part half the inner one.
    ///
    /// # Errors
    /// If an option is out of range, the mesh is empty, the memory cannot be had, or the monitor
    /// cancels.
    pub fn compute(
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        lattice: &Lattice,
        options: &DensityOptions,
        monitor: &dyn Monitor,
    ) -> Result<Self, DensityError> {
        options.validate()?;
        let recipe = FieldRecipe::new(mesh, kernel, lattice, options);
        Self::follow(recipe, mesh, kernel, monitor)
    }

    /// Computes the field of a recipe, which must be that of `mesh` and `kernel`.
    pub(crate) fn follow(
        recipe: FieldRecipe,
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        monitor: &dyn Monitor,
    ) -> Result<Self, DensityError> {
        let mut field = Self::allocate(recipe)?;
        sampling::fill(&mut field, mesh, kernel, monitor)?;
        Ok(field)
    }

    /// Where the values sit, in the part's own frame.
    pub fn lattice(&self) -> &Lattice {
        &self.recipe.lattice
    }

    /// Memory that [`DensityField::compute`] needs for the values on `lattice`, bytes.
    pub fn memory_bytes(lattice: &Lattice) -> u64 {
        let node = 2 * size_of::<Complex32>() + size_of::<f32>();
        lattice.len() as u64 * node as u64
    }

    /// `l1 * exterior + l2 * interior` at every node.
    pub fn combined(&self, lambda_exterior: f32, lambda_interior: f32) -> Array3<Complex32> {
        Zip::from(&self.exterior)
            .and(&self.interior)
            .par_map_collect(|o, i| o * lambda_exterior + i * lambda_interior)
    }

    /// A field of zeros.
    pub(crate) fn allocate(recipe: FieldRecipe) -> Result<Self, DensityError> {
        let lattice = &recipe.lattice;
        let bytes = Self::memory_bytes(lattice);
        Ok(Self {
            exterior: zeros(lattice).ok_or(DensityError::Memory { bytes })?,
            interior: zeros(lattice).ok_or(DensityError::Memory { bytes })?,
            signed_distance: zeros(lattice).ok_or(DensityError::Memory { bytes })?,
            recipe,
        })
    }
}

/// An array of zeros on `lattice`, or none if the memory cannot be had. Untouched: its pages are first
/// written by the threads that fill them.
fn zeros<T: Zeroable>(lattice: &Lattice) -> Option<Array3<T>> {
    let values = bytemuck::allocation::try_zeroed_vec(lattice.len()).ok()?;
    large::ask_for_large_pages(&values);
    Array3::from_shape_vec(lattice.shape(), values).ok()
}
