//! Density and gradient at one point, as two unit parts.

use glam::DVec3;
use num_complex::Complex64;

use super::edge_gradient::FaceGradient;

/// The two unit parts of the density at one point.
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

    /// From the sum over faces, the extended gradient of the unsigned distance, and what one metre
    /// is in the sum's unit of length.
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
