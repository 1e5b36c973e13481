//! The exact reduction of a flat face's surface integral to integrals along its edges, in f64.
//!
//! On the plane of a face at signed height `h` the solid angle is
//! `dOmega = h d(eta) d(phi) / eta^2`, so the radial integral is a difference of the cumulative
//! kernel `K` and what remains is one smooth integral per edge:
//!
//! `integral = (h / |xi|) * sum over edges of integral of d (K(u(t)) - K0) / (d^2 + t^2) dt`
//!
//! with `u = sqrt(h^2 + d^2 + t^2) / |xi|`, `K0 = K(|h| / |xi|)` and `d` the distance of the
//! point's foot from the edge's line, positive towards the face. Where `u` is beyond the
//! kernel's reach `K` is constant and the integral is an angle.

use glam::DVec3;
use num_complex::Complex64;

use crate::field::kernel::CumulativeKernel;
use crate::field::quadrature::GaussLegendre;
use crate::surface::face::Face;

/// How finely the edge integrals are taken.
#[derive(Debug, Clone)]
pub(crate) struct EdgeQuadrature {
    rule: GaussLegendre,
    pub(super) short: GaussLegendre,
    /// Panels per `|xi|` of edge length.
    panels: f64,
    /// `1 + reach * sigma`: beyond this `u` the kernel is zero.
    largest_u: f64,
}

/// An edge from the foot of a point on its line.
pub(super) struct Span {
    /// Distance of the point's foot in the plane from the line, positive towards the face.
    pub(super) d: f64,
    /// The part within reach, along the line from the foot.
    pub(super) near: Option<(f64, f64)>,
    /// Angle under which the foot sees the rest, radians.
    pub(super) beyond: f64,
}

impl EdgeQuadrature {
    /// `reach` in kernel widths; panels of `order` points are at most `panel * sqrt(sigma) * |xi|`
    /// long, the width over which `K` varies along an edge.
    pub(crate) fn new(sigma: f64, reach: f64, order: usize, panel: f64) -> Self {
        Self {
            rule: GaussLegendre::new(order),
            short: GaussLegendre::new(3),
            panels: 1.0 / (panel * sigma.sqrt()),
            largest_u: 1.0 + reach * sigma,
        }
    }

    /// Distance beyond which a boundary point does not count, for a query at distance `xi`.
    pub(crate) fn radius(&self, xi: f64) -> f64 {
        self.largest_u * xi
    }

    /// The integral of [`crate::DensityKernel::unit`] over the solid angle of `face` seen from
    /// `p`, a point at distance `xi > 0` from the whole boundary.
    pub(crate) fn face(
        &self,
        table: &CumulativeKernel,
        face: &Face,
        p: DVec3,
        xi: f64,
    ) -> Complex64 {
        let h = face.height(p);
        let reach = self.radius(xi);
        if h == 0.0 || h.abs() >= reach || face.distance_squared(p) >= reach * reach {
            return Complex64::ZERO;
        }
        let plane = Plane::new(table, h, xi);
        let edges = (0..face.count).map(|k| self.edge(&plane, face, k, p));
        edges.sum::<Complex64>() * (h / xi)
    }

    /// Edge `k` seen from `p`, whose face's plane is `h` away, within the kernel's reach at `xi`.
    pub(super) fn span(&self, h: f64, xi: f64, face: &Face, k: usize, p: DVec3) -> Span {
        let from = face.corners[k] - p;
        let d = from.dot(face.outward[k]);
        let start = from.dot(face.along[k]);
        let end = start + face.length[k];
        let reach = self.radius(xi);
        let clip = (reach * reach - h * h - d * d).max(0.0).sqrt();
        let (from, to) = (start.clamp(-clip, clip), end.clamp(-clip, clip));
        let angle = |a: f64, b: f64| (d * (b - a)).atan2(d * d + a * b);
        if from >= to {
            let beyond = angle(start, end);
            return Span {
                d,
                near: None,
                beyond,
            };
        }
        Span {
            d,
            near: Some((from, to)),
            beyond: angle(start, end) - angle(from, to),
        }
    }

    fn edge(&self, plane: &Plane<'_>, face: &Face, k: usize, p: DVec3) -> Complex64 {
        let Span { d, near, beyond } = self.span(plane.h, plane.xi, face, k, p);
        let mut sum = plane.beyond * beyond;
        let Some((from, to)) = near else {
            return sum;
        };
        for (t, w) in self.nodes(from, to, plane.xi) {
            sum += plane.integrand(d * d + t * t, &self.short) * (w * d);
        }
        sum
    }

    /// Nodes and weights between `from` and `to` along an edge.
    pub(super) fn nodes(
        &self,
        from: f64,
        to: f64,
        xi: f64,
    ) -> impl Iterator<Item = (f64, f64)> + '_ {
        let count = ((to - from) / xi * self.panels).ceil().max(1.0) as usize;
        let width = (to - from) / count as f64;
        (0..count).flat_map(move |i| {
            let a = from + width * i as f64;
            self.rule.on(a, a + width)
        })
    }
}

/// What the edges of a face share for one query point.
struct Plane<'a> {
    table: &'a CumulativeKernel,
    h: f64,
    xi: f64,
    /// `|h| / xi`.
    u0: f64,
    /// `K(u0)`.
    k0: Complex64,
    /// `K(infinity) - K(u0)`.
    beyond: Complex64,
}

impl<'a> Plane<'a> {
    fn new(table: &'a CumulativeKernel, h: f64, xi: f64) -> Self {
        let u0 = h.abs() / xi;
        let k0 = table.evaluate((u0 - 1.0) / table.kernel().sigma());
        let beyond = table.total() - k0;
        Self {
            table,
            h,
            xi,
            u0,
            k0,
            beyond,
        }
    }

    /// `(K(u) - K0) / r2` at squared distance `r2` from the foot; near the foot, where that is a
    /// difference of near equals, as a mean slope.
    fn integrand(&self, r2: f64, short: &GaussLegendre) -> Complex64 {
        let sigma = self.table.kernel().sigma();
        let u = (r2 + self.h * self.h).sqrt() / self.xi;
        let slope_scale = 1.0 / (self.xi * self.xi * (u + self.u0));
        let rise = r2 * slope_scale;
        if rise > 0.05 * sigma {
            return (self.table.evaluate((u - 1.0) / sigma) - self.k0) / r2;
        }
        let slope = |(v, w): (f64, f64)| {
            self.table.kernel().cumulative_slope((v - 1.0) / sigma) * (w / sigma)
        };
        let mean = short
            .on(0.0, 1.0)
            .map(|(f, w)| slope((self.u0 + rise * f, w)));
        mean.sum::<Complex64>() * slope_scale
    }
}
