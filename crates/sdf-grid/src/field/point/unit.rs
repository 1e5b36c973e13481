//! Density at one point, as two unit parts.

use num_complex::Complex64;

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
