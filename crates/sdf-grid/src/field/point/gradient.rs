//! The gradient of the density (eq_3a) at single points.

use glam::DVec3;
use rayon::prelude::*;

use super::boundary;
use super::distance_gradient::{EQUALLY_NEAR, extended_gradient};
use super::edge_gradient::FaceGradient;
use super::edge_integral::EdgeQuadrature;
use super::unit::UnitGradient;
use crate::field::error::DensityError;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;
use crate::surface::coplanar::pieces;

/// Evaluates the gradient of the density of one mesh (eq_3a) in f64, through the hierarchy that
/// fields are computed with.
///
/// The distance enters by its extended gradient: on the medial axis, where the distance has a
/// crease, the gradient is the limit along the axis, and across a sheet of it the mean direction of
/// the two sides (zero in the middle of a plate). The density itself has a crease there too, so
/// that no difference quotient across the medial axis converges to it; along the axis they do.
#[derive(Debug, Clone)]
pub struct DensityGradient {
    bvh: Bvh,
    table: CumulativeKernel,
    quadrature: EdgeQuadrature,
}

impl DensityGradient {
    /// Prepares `mesh` for the kernel.
    ///
    /// # Errors
    /// If the mesh has no triangle with an area.
    pub fn new(mesh: &TriangleMesh, kernel: &DensityKernel) -> Result<Self, DensityError> {
        let bvh = Bvh::merged(mesh, pieces::EXACT, Leaves::Small);
        if bvh.faces.is_empty() {
            return Err(DensityError::EmptyMesh);
        }
        Ok(Self {
            bvh,
            table: CumulativeKernel::new(*kernel),
            // Beyond 6.5 widths the kernel is below 1e-9; panels of 10 points and a third of the
            // width over which it varies along an edge are converged to about 1e-8.
            quadrature: EdgeQuadrature::new(kernel.sigma(), 6.5, 10, 0.35),
        })
    }

    /// Value and gradient at `p`, metres in the part's frame, to about 1e-6. None on the boundary,
    /// where the density jumps.
    pub fn at(&self, p: DVec3) -> Option<UnitGradient> {
        let q = self.bvh.normalized(p);
        let xi = self.bvh.nearest_normalized(q).1.sqrt();
        // The largest normalized extent is in (1, 2].
        if xi <= 2.0 * boundary::BAND {
            return None;
        }
        let mut nearest = Vec::new();
        let near = xi + 2.0 * EQUALLY_NEAR;
        self.bvh.visit_within(q, near, |i| {
            let face = &self.bvh.faces[i];
            if face.distance_squared(q) <= near * near {
                nearest.push((q - face.closest(q)).normalize());
            }
        });
        let mut sum = FaceGradient::default();
        self.bvh.visit_within(q, self.quadrature.radius(xi), |i| {
            let face = &self.bvh.faces[i];
            sum.add(&self.quadrature.face_gradient(&self.table, face, q, xi));
        });
        let inside = self.bvh.inside_normalized(q);
        let distance = extended_gradient(&nearest);
        Some(UnitGradient::new(&sum, distance, inside, self.bvh.scale()))
    }

    /// [`DensityGradient::at`] of every point, on rayon's current thread pool.
    pub fn at_all(&self, points: &[DVec3]) -> Vec<Option<UnitGradient>> {
        points.par_iter().map(|p| self.at(*p)).collect()
    }
}
