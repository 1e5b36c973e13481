//! The density by brute force over every triangle, in f64: slow, plain, the measure of the fast
//! path.

use glam::DVec3;

use super::density::{BAND, UnitDensity, averaged_normal};
use super::edge_integral::EdgeQuadrature;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::face::{Face, Piece};

/// Evaluates distance, winding number and density of one mesh point by point.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{DensityKernel, DensityProbe, ReferenceDensity, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let kernel = DensityKernel::new(0.2)?;
/// let reference = ReferenceDensity::new(&cube, &kernel);
/// let p = DVec3::new(0.001, 0.002, 0.004);
/// assert!((reference.signed_distance(p) + 0.001).abs() < 1e-12);
/// let fast = DensityProbe::new(&cube, &kernel)?.at(p).expect("off the boundary");
/// assert!((reference.unit_density(p, 1e-6).interior - fast.interior).norm() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ReferenceDensity {
    triangles: Vec<Face>,
    table: CumulativeKernel,
    quadrature: EdgeQuadrature,
    size: f64,
}

impl ReferenceDensity {
    /// Prepares `mesh` for the kernel. Zero-area triangles do not count.
    pub fn new(mesh: &TriangleMesh, kernel: &DensityKernel) -> Self {
        let triangles: Vec<Face> = (0..mesh.triangles().len())
            .filter_map(|i| Piece::triangle(mesh.corners(i), i as u32))
            .map(|t| Face::new(&t))
            .collect();
        let corners = || triangles.iter().flat_map(|t| t.corners);
        let lo = corners().fold(DVec3::INFINITY, DVec3::min);
        let hi = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self {
            size: (hi - lo).max_element(),
            triangles,
            table: CumulativeKernel::new(*kernel),
            // Twelve points per half kernel width: converged to about 1e-12.
            quadrature: EdgeQuadrature::new(kernel.sigma(), 8.4, 12, 0.25),
        }
    }

    /// Distance to the boundary, metres.
    pub fn distance(&self, p: DVec3) -> f64 {
        let squares = self.triangles.iter().map(|t| t.distance_squared(p));
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Generalized winding number: 1 inside a closed outward-oriented mesh, 0 outside.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        let sum: f64 = self.triangles.iter().map(|t| t.solid_angle(p)).sum();
        -sum / (4.0 * std::f64::consts::PI)
    }

    /// Distance to the boundary, metres, negative inside (winding number above 1/2).
    pub fn signed_distance(&self, p: DVec3) -> f64 {
        let distance = self.distance(p);
        if self.winding_number(p) > 0.5 {
            -distance
        } else {
            distance
        }
    }

    /// Both unit parts at `p` (eq_3). On the boundary they are half of each one-sided limit, taken
    /// `step` metres from it along the averaged normal.
    pub fn unit_density(&self, p: DVec3, step: f64) -> UnitDensity {
        if self.distance(p) > BAND * self.size {
            return self.off_boundary(p);
        }
        let normal = averaged_normal(self.triangles.iter(), p, BAND * self.size);
        let side = |s: f64| self.off_boundary(p + normal * (s * step));
        UnitDensity::mean(side(1.0), side(-1.0))
    }

    fn off_boundary(&self, p: DVec3) -> UnitDensity {
        let xi = self.distance(p);
        if xi == 0.0 {
            return UnitDensity::default();
        }
        let term = |t| self.quadrature.face(&self.table, t, p, xi);
        let integral = self.triangles.iter().map(term).sum();
        UnitDensity::from_integral(integral, self.winding_number(p) > 0.5)
    }

    /// The paper's midpoint sum (eq_10) at `p`: one sample per triangle. A baseline, not an oracle.
    pub fn midpoint_sum(&self, p: DVec3) -> UnitDensity {
        let xi = self.distance(p);
        let kernel = self.table.kernel();
        let term = |t: &Face| {
            let r = (p - t.centroid) / xi;
            kernel.radial(r.length())[0] * (r.dot(t.normal) * t.area / (xi * xi))
        };
        let integral = self.triangles.iter().map(term).sum();
        UnitDensity::from_integral(integral, self.winding_number(p) > 0.5)
    }
}
