//! The complex skeletal density of a mesh on a lattice.

use ndarray::{Array3, Zip};
use num_complex::Complex32;

use super::kernel::DensityKernel;
use super::lattice::{Lattice, zeros};
use super::options::{DensityError, DensityOptions, Sampling};
use super::provenance::FieldProvenance;
use super::sampling::blocks::Arrays;
use super::sampling::fill::{fill, taper, working_bytes};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::monitor::Monitor;

/// The density of one part on a lattice, as two unit parts: `rho = l1 * exterior + l2 * interior`.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{DensityField, DensityKernel, DensityOptions, Lattice, Silent, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let lattice = Lattice::covering(&cube.bounds(), 0.004, 0.001)?;
/// let (kernel, options) = (DensityKernel::new(0.2)?, DensityOptions::default());
/// let field = DensityField::compute(&cube, &kernel, &lattice, &options, &Silent)?;
/// // The first node is a corner of the lattice, far outside.
/// assert!(field.signed_distance[[0, 0, 0]] > 0.004);
/// assert_eq!(field.interior[[0, 0, 0]].norm(), 0.0);
/// assert!(field.exterior[[0, 0, 0]].norm() > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DensityField {
    /// Unit exterior density `O` (dimensionless), zero inside the part; includes the halo cut-off.
    pub exterior: Array3<Complex32>,
    /// Unit interior density `I` (dimensionless), zero outside the part.
    pub interior: Array3<Complex32>,
    /// Distance to the boundary at the node, metres, negative inside.
    pub signed_distance: Array3<f32>,
    /// What the values depend on.
    pub provenance: FieldProvenance,
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
        let provenance = FieldProvenance::new(mesh, kernel, lattice, options);
        Self::follow(provenance, mesh, kernel, monitor)
    }

    /// Computes the field of a provenance, which must be that of `mesh` and `kernel`.
    pub(crate) fn follow(
        provenance: FieldProvenance,
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        monitor: &dyn Monitor,
    ) -> Result<Self, DensityError> {
        let mut field = Self::allocate(provenance)?;
        let arrays = Arrays {
            exterior: field.exterior.view_mut(),
            interior: field.interior.view_mut(),
            signed_distance: field.signed_distance.view_mut(),
        };
        fill(&field.provenance, arrays, mesh, kernel, monitor)?;
        Ok(field)
    }

    /// Where the values sit, in the part's own frame.
    pub fn lattice(&self) -> &Lattice {
        &self.provenance.lattice
    }

    /// Memory that the values on `lattice` take, bytes.
    pub fn memory_bytes(lattice: &Lattice) -> u64 {
        let node = 2 * size_of::<Complex32>() + size_of::<f32>();
        lattice.len() as u64 * node as u64
    }

    /// Memory that [`DensityField::compute`] takes beside the values while it runs, bytes.
    pub fn working_bytes(lattice: &Lattice, sampling: Sampling) -> u64 {
        working_bytes(lattice, sampling)
    }

    /// `l1 * exterior + l2 * interior` at every node.
    pub fn combined(&self, lambda_exterior: f32, lambda_interior: f32) -> Array3<Complex32> {
        Zip::from(&self.exterior)
            .and(&self.interior)
            .par_map_collect(|o, i| o * lambda_exterior + i * lambda_interior)
    }

    /// What the part would score in a perfect mould of itself with weights of one, cubic metres.
    ///
    /// Everywhere the mould is outside where the part is inside, and its density is the part's
    /// conjugate: `∫ |O|² + |I|² dV`, the interior faded with depth as the mould's exterior is. `O`
    /// conjugated goes on in `I` across faces, so that smoothing the two together loses little: it is
    /// `∫ |O* + I|² dV` of smoothed fields, too.
    pub fn mould_score(&self) -> f64 {
        let halo = self.provenance.halo;
        let nodes = Zip::from(&self.exterior)
            .and(&self.interior)
            .and(&self.signed_distance);
        let cell = self.lattice().spacing().powi(3);
        cell * nodes.fold(0.0, |sum, o, i, distance| {
            let faded = taper(-f64::from(*distance), halo).sqrt() as f32;
            sum + f64::from((o.conj() + i * faded).norm_sqr())
        })
    }

    /// A field of zeros.
    pub(crate) fn allocate(provenance: FieldProvenance) -> Result<Self, DensityError> {
        let lattice = &provenance.lattice;
        let bytes = Self::memory_bytes(lattice);
        Ok(Self {
            exterior: zeros(lattice.shape()).ok_or(DensityError::Memory { bytes })?,
            interior: zeros(lattice.shape()).ok_or(DensityError::Memory { bytes })?,
            signed_distance: zeros(lattice.shape()).ok_or(DensityError::Memory { bytes })?,
            provenance,
        })
    }
}
