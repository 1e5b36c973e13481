//! The gradient of one face's integral by integrals along its edges, in f64.
//!
//! With the notation of [`super::edge_integral`], `G` of [`crate::DensityKernel::radial`] and
//! `P = sum over edges of integral of d (K(u) - K0) / (d^2 + t^2) dt`, the face's integral is
//! `(h / |xi|) P`. At fixed `|xi|` the divergence theorem gives the gradient of `P` in the plane
//! and the polar form its derivative along the normal:
//!
//! `grad P = -(1 / xi^2) sum over edges of m * integral of G(u) dt`
//! `       + n (h / xi^2) sum over edges of integral of d (G(u) - G0) / (d^2 + t^2) dt`
//!
//! with `m` the outward normal of the edge in the plane. With respect to `|xi|` the integral has
//! the derivative `-(h / xi^2) (P + Q)`, where `Q` is `P` with `u^2 G` in place of `K`.
//!
//! The constants subtracted (`K0`, ...) are those at `max(|h| / |xi|, 1/2)`, continued analytically
//! below 1. `G` has a pole at zero; but where `|h|` is less than `|xi|` the foot lies outside the
//! face, so that any constant serves, and where it is less than half of it, far outside.

use glam::DVec3;
use num_complex::Complex64;

use super::edge_integral::{EdgeQuadrature, Span};
use crate::field::kernel::CumulativeKernel;
use crate::surface::face::Face;

/// Least `u` whose values are subtracted.
const LEAST: f64 = 0.5;

/// `K(u)`, `G(u)`, `u^2 G(u)`, or integrals of them.
type Radial = [Complex64; 3];

/// What one face adds to the gradient.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FaceGradient {
    /// The integral of the unit kernel itself.
    pub(crate) value: Complex64,
    /// Its gradient with respect to the point at fixed distance, per coordinate.
    pub(crate) point: [Complex64; 3],
    /// Its derivative with respect to the unsigned distance.
    pub(crate) distance: Complex64,
}

impl FaceGradient {
    pub(crate) fn add(&mut self, other: &Self) {
        self.value += other.value;
        for (a, b) in self.point.iter_mut().zip(other.point) {
            *a += b;
        }
        self.distance += other.distance;
    }

    fn add_along(&mut self, direction: DVec3, amount: Complex64) {
        for (k, sum) in self.point.iter_mut().enumerate() {
            *sum += amount * direction[k];
        }
    }
}

impl EdgeQuadrature {
    /// Value and derivatives of [`EdgeQuadrature::face`].
    pub(crate) fn face_gradient(
        &self,
        table: &CumulativeKernel,
        face: &Face,
        p: DVec3,
        xi: f64,
    ) -> FaceGradient {
        let mut sum = FaceGradient::default();
        let h = face.height(p);
        let reach = self.radius(xi);
        if h.abs() >= reach || face.distance_squared(p) >= reach * reach {
            return sum;
        }
        let plane = Plane::new(table, h, xi);
        let mut swept = Radial::default();
        for k in 0..face.count {
            let (edge, length) = self.edge_gradient(&plane, face, k, p);
            swept = std::array::from_fn(|i| swept[i] + edge[i]);
            sum.add_along(face.outward[k], -length * (h / xi.powi(3)));
        }
        let [p, g, q] = swept;
        sum.value = p * (h / xi);
        sum.add_along(face.normal, p / xi + g * (h * h / xi.powi(3)));
        sum.distance = -(p + q) * (h / (xi * xi));
        sum
    }

    /// Of one edge, the integrals of `d (f(u) - f0) / (d^2 + t^2)` for every `f`, and that of `G`.
    fn edge_gradient(
        &self,
        plane: &Plane<'_>,
        face: &Face,
        k: usize,
        p: DVec3,
    ) -> (Radial, Complex64) {
        let Span { d, near, beyond } = self.span(plane.h, plane.xi, face, k, p);
        let mut sum = plane.beyond.map(|v| v * beyond);
        let Some((from, to)) = near else {
            return (sum, Complex64::ZERO);
        };
        let mut length = Complex64::ZERO;
        for (t, w) in self.nodes(from, to, plane.xi) {
            let (rise, g) = plane.integrand(d * d + t * t, self);
            sum = std::array::from_fn(|i| sum[i] + rise[i] * (w * d));
            length += g * w;
        }
        (sum, length)
    }
}

/// What the edges of a face share for one query point.
struct Plane<'a> {
    table: &'a CumulativeKernel,
    h: f64,
    xi: f64,
    /// `max(|h| / xi, LEAST)`.
    base: f64,
    at_base: Radial,
    /// Values at infinity less those at `base`.
    beyond: Radial,
}

impl<'a> Plane<'a> {
    fn new(table: &'a CumulativeKernel, h: f64, xi: f64) -> Self {
        let base = (h.abs() / xi).max(LEAST);
        let at_base = radial(table, base);
        let [k, g, q] = at_base;
        Self {
            table,
            h,
            xi,
            base,
            at_base,
            beyond: [table.total() - k, -g, -q],
        }
    }

    /// `(f(u) - f0) / r2` at squared distance `r2` from the foot for every `f`, and `G(u)`; near
    /// the foot, where that is a difference of near equals, as a mean slope.
    fn integrand(&self, r2: f64, quadrature: &EdgeQuadrature) -> (Radial, Complex64) {
        let sigma = self.table.kernel().sigma();
        let u2 = (r2 + self.h * self.h) / (self.xi * self.xi);
        let u = u2.sqrt();
        let values = radial(self.table, u);
        // `u^2 - base^2` without cancellation where `base` is `|h| / xi`.
        let squares = if self.base > LEAST {
            r2 / (self.xi * self.xi)
        } else {
            u2 - LEAST * LEAST
        };
        let rise = squares / (u + self.base);
        if rise > 0.05 * sigma {
            let quotient = |i: usize| (values[i] - self.at_base[i]) / r2;
            return (std::array::from_fn(quotient), values[1]);
        }
        let mut mean = Radial::default();
        for (f, w) in quadrature.short.on(0.0, 1.0) {
            let slope = slopes(self.table, self.base + rise * f);
            mean = std::array::from_fn(|i| mean[i] + slope[i] * w);
        }
        (mean.map(|m| m * (rise / r2.max(1e-300))), values[1])
    }
}

fn radial(table: &CumulativeKernel, u: f64) -> Radial {
    let kernel = table.kernel();
    let g = kernel.radial(u)[0];
    [table.at((u - 1.0) / kernel.sigma()), g, g * (u * u)]
}

/// Derivatives of [`radial`] with respect to `u`.
fn slopes(table: &CumulativeKernel, u: f64) -> Radial {
    let [g, g1, _] = table.kernel().radial(u);
    [g * u, g1, g1 * (u * u) + g * (2.0 * u)]
}
