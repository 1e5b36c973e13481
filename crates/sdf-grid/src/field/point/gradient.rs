//! The gradient of the density (eq_3a) at single points.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::DensityError;
use super::boundary;
use super::distance_gradient::extended_gradient;
use super::edge_gradient::FaceGradient;
use super::edge_integral::EdgeQuadrature;
use super::reference::UnitDensity;
use crate::TriangleMesh;
use crate::bvh::{Bvh, Leaves};
use crate::coplanar;
use crate::kernel::{CumulativeKernel, DensityKernel};

/// Boundary points count as equally near if their distances differ by less than this, in units of the
/// part's largest extent: far above rounding, far below any distance from the medial axis that matters.
pub(crate) const EQUALLY_NEAR: f64 = 1e-9;

/// Value and gradient of the two unit parts of the density at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UnitGradient {
    /// The density itself, dimensionless.
    pub density: UnitDensity,
    /// Gradient of the exterior part in the part's frame, per metre; zero inside the part.
    pub exterior: [Complex64; 3],
    /// Gradient of the interior part in the part's frame, per metre; zero outside the part.
    pub interior: [Complex64; 3],
}

impl UnitGradient {
    /// The gradient of `l1 * exterior + l2 * interior`, per metre.
    pub fn combined(&self, lambda_exterior: f64, lambda_interior: f64) -> [Complex64; 3] {
        let [o, i] = [self.exterior, self.interior];
        std::array::from_fn(|k| o[k] * lambda_exterior + i[k] * lambda_interior)
    }

    /// From the sum over faces, the extended gradient of the unsigned distance, and what one metre is
    /// in the sum's unit of length.
    pub(crate) fn new(sum: &FaceGradient, distance: DVec3, inside: bool, scale: f64) -> Self {
        let slope = |k: usize| (sum.point[k] + sum.distance * distance[k]) * scale;
        let parts = [0, 1, 2].map(|k| UnitDensity::from_integral(slope(k), inside));
        Self {
            density: UnitDensity::from_integral(sum.value, inside),
            exterior: parts.map(|p| p.exterior),
            interior: parts.map(|p| p.interior),
        }
    }
}

/// Evaluates the gradient of the density of one mesh (eq_3a) in f64, through the hierarchy that fields
/// are computed with.
///
/// The distance enters by its extended gradient: on the medial axis, where the distance has a crease,
/// the gradient is the limit along the axis, and across a sheet of it the mean direction of the two
/// sides (zero in the middle of a plate). The density itself has a crease there too, so that no
/// difference quotient across the medial axis converges to it; along the axis they do.
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
        let bvh = Bvh::merged(mesh, coplanar::EXACT, Leaves::Small);
        if bvh.faces.is_empty() {
            return Err(DensityError::EmptyMesh);
        }
        Ok(Self {
            bvh,
            table: CumulativeKernel::new(*kernel),
            // Beyond 6.5 widths the kernel is below 1e-9; panels of 10 points and a third of the width
            // over which it varies along an edge are converged to about 1e-8.
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
