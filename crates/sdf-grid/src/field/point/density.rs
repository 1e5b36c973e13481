//! The density at single points in f64, through the tree; and a density as two unit parts.

use glam::DVec3;
use num_complex::Complex64;

use super::edge_integral::EdgeQuadrature;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::field::options::DensityError;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;
use crate::surface::coplanar::pieces;
use crate::surface::face::Face;

/// The two unit parts of the density at one point.
///
/// See the example of [`DensityProbe`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UnitDensity {
    /// Unit exterior density, dimensionless; zero inside the part.
    pub exterior: Complex64,
    /// Unit interior density, dimensionless; zero outside the part.
    pub interior: Complex64,
}

impl UnitDensity {
    /// The parts from the integral of [`DensityKernel::unit`] over the signed solid angle, outside
    /// (`inside` false, positive solid angle) or inside (negative).
    pub(crate) fn from_integral(integral: Complex64, inside: bool) -> Self {
        let value = if inside { -integral } else { integral.conj() };
        Self::of_side(value, inside)
    }

    /// A point's unit density, inside or outside.
    pub(crate) fn of_side(value: Complex64, inside: bool) -> Self {
        let mut parts = Self::default();
        *if inside {
            &mut parts.interior
        } else {
            &mut parts.exterior
        } = value;
        parts
    }

    /// `l1 * exterior + l2 * interior`.
    pub fn combined(&self, lambda_exterior: f64, lambda_interior: f64) -> Complex64 {
        self.exterior * lambda_exterior + self.interior * lambda_interior
    }

    pub(crate) fn mean(a: Self, b: Self) -> Self {
        Self {
            exterior: 0.5 * (a.exterior + b.exterior),
            interior: 0.5 * (a.interior + b.interior),
        }
    }
}

/// Density at single points by the hierarchy: the faces within the kernel's reach, each by its
/// edge integrals. Coordinates are normalized ([`Bvh::normalized`]).
pub(crate) struct PointDensity<'a> {
    bvh: &'a Bvh,
    table: &'a CumulativeKernel,
    quadrature: EdgeQuadrature,
}

impl<'a> PointDensity<'a> {
    pub(crate) fn new(bvh: &'a Bvh, table: &'a CumulativeKernel) -> Self {
        Self {
            bvh,
            table,
            // Beyond 6 widths the kernel is below 2e-8; panels of 8 points and half a kernel width
            // are converged to about 1e-7.
            quadrature: EdgeQuadrature::new(table.kernel().sigma(), 6.0, 8, 0.8),
        }
    }

    /// Signed distance and both unit parts at `q`. On the boundary the parts are half of each
    /// one-sided limit, taken `step` from it.
    pub(crate) fn evaluate(&self, q: DVec3, step: f64) -> (f64, UnitDensity) {
        let distance = self.bvh.nearest_normalized(q).1.sqrt();
        // The largest normalized extent is in (1, 2].
        let band = 2.0 * BAND;
        if distance > band {
            return self.off_boundary(q, distance);
        }
        let normal = self.normal(q, band);
        let side = |s: f64| {
            let p = q + normal * (s * step);
            self.off_boundary(p, self.bvh.nearest_normalized(p).1.sqrt())
                .1
        };
        (0.0, UnitDensity::mean(side(1.0), side(-1.0)))
    }

    fn off_boundary(&self, q: DVec3, distance: f64) -> (f64, UnitDensity) {
        if distance == 0.0 {
            return (0.0, UnitDensity::default());
        }
        let inside = self.bvh.inside_normalized(q);
        let density = UnitDensity::from_integral(
            self.quadrature.sum(self.bvh, self.table, q, distance),
            inside,
        );
        (if inside { -distance } else { distance }, density)
    }

    fn normal(&self, q: DVec3, band: f64) -> DVec3 {
        let mut near = Vec::new();
        self.bvh
            .visit_within(q, band * 1.001, |i| near.push(&self.bvh.faces[i]));
        averaged_normal(near.into_iter(), q, band)
    }
}

/// The density of one mesh at single points in f64, through the hierarchy that fields are computed
/// with.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{DensityKernel, DensityProbe, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let probe = DensityProbe::new(&cube, &DensityKernel::new(0.2)?)?;
/// let outside = probe.at(DVec3::new(0.0, 0.0, 0.006)).expect("off the boundary");
/// assert_eq!(outside.interior.norm(), 0.0);
/// // Twice the weight of the exterior, twice the density.
/// assert_eq!(outside.combined(2.0, 1.0), outside.exterior * 2.0);
/// assert!(probe.at(DVec3::new(0.0, 0.0, 0.005)).is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct DensityProbe {
    bvh: Bvh,
    table: CumulativeKernel,
    quadrature: EdgeQuadrature,
}

impl DensityProbe {
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

    /// Both unit parts at `p`, metres in the part's frame, to about 1e-8. None on the boundary,
    /// where the density jumps.
    pub fn at(&self, p: DVec3) -> Option<UnitDensity> {
        let q = self.bvh.normalized(p);
        let distance = self.bvh.nearest_normalized(q).1.sqrt();
        // The largest normalized extent is in (1, 2].
        (distance > 2.0 * BAND).then(|| {
            let integral = self.quadrature.sum(&self.bvh, &self.table, q, distance);
            UnitDensity::from_integral(integral, self.bvh.inside_normalized(q))
        })
    }
}

impl EdgeQuadrature {
    /// The integral over all faces of a hierarchy within reach of `q`, at distance `xi` from them.
    fn sum(&self, bvh: &Bvh, table: &CumulativeKernel, q: DVec3, xi: f64) -> Complex64 {
        let mut sum = Complex64::ZERO;
        bvh.visit_within(q, self.radius(xi), |i| {
            sum += self.face(table, &bvh.faces[i], q, xi);
        });
        sum
    }
}

/// A point nearer than this, in units of the part's largest extent, lies on the boundary. Far
/// above the rounding of f64 coordinates, far below any length that matters.
pub(crate) const BAND: f64 = 1e-9;

/// Step to either side, in units of the lattice spacing.
pub(crate) const STEP: f64 = 1e-4;

/// The angle-weighted normal of the boundary at `p`, over the faces within `band`; a unit
/// vector.
pub(crate) fn averaged_normal<'a>(
    faces: impl Iterator<Item = &'a Face>,
    p: DVec3,
    band: f64,
) -> DVec3 {
    let (mut sum, mut first) = (DVec3::ZERO, None);
    for t in faces.filter(|t| t.distance_squared(p) <= band * band) {
        sum += t.normal * angle_at(t, p, band);
        first.get_or_insert(t.normal);
    }
    // Opposite faces of a sheet without thickness cancel: either normal then serves.
    let fallback = first.unwrap_or(DVec3::X);
    if sum.length() > 1e-6 {
        sum.normalize()
    } else {
        fallback
    }
}

/// The angle the face fills around `p`, a point on it: a full turn inside, half on an edge,
/// the corner's angle on a corner.
fn angle_at(t: &Face, p: DVec3, band: f64) -> f64 {
    use std::f64::consts::PI;
    if let Some(k) = (0..t.count).find(|&k| t.corners[k].distance(p) <= band) {
        return t.along[k].angle_between(-t.along[(k + t.count - 1) % t.count]);
    }
    let on_edge = (0..t.count).any(|k| (p - t.corners[k]).dot(t.outward[k]).abs() <= band);
    if on_edge { PI } else { 2.0 * PI }
}
