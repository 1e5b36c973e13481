//! Second-order moments of a cluster of triangles, for its effect seen from afar.
//!
//! For an integrand `G(|r|) (r . n)` with `r = (p - q) / |xi|`, expanding `q` about the centroid
//! `c` to second order needs the area vector `N`, the area covariance `C` and the symmetric first
//! moment `M` of the normals.

use glam::{DMat3, DVec3};

use crate::triangle::Triangle;

/// Moments about the area centroid.
#[derive(Debug, Clone)]
pub(crate) struct Moments {
    /// Area centroid `c`.
    pub(crate) centre: DVec3,
    /// `N`, the integral of the normal.
    pub(crate) area_vector: DVec3,
    /// `C`, the mean of `(q - c)(q - c)^T` over the area.
    pub(crate) covariance: DMat3,
    /// `M`, the symmetric part of the integral of `n (q - c)^T`.
    pub(crate) normal_moment: DMat3,
    /// Largest distance of a corner from the centroid.
    pub(crate) radius: f64,
    /// Sine of the largest angle between a normal and `N`; 1 from a right angle on.
    pub(crate) spread: f64,
}

impl Moments {
    /// Of a non-empty set of triangles with area.
    pub(crate) fn of(triangles: &[Triangle]) -> Self {
        let area: f64 = triangles.iter().map(|t| t.area).sum();
        let weighted = triangles.iter().map(|t| t.centroid * t.area);
        let centre = weighted.sum::<DVec3>() / area;
        let area_vector: DVec3 = triangles.iter().map(|t| t.normal * t.area).sum();
        let axis = area_vector.try_normalize().unwrap_or(DVec3::Z);
        let (mut covariance, mut normal_moment) = (DMat3::ZERO, DMat3::ZERO);
        let (mut radius, mut cosine) = (0f64, 1f64);
        for t in triangles {
            let d = t.centroid - centre;
            covariance += (triangle_covariance(t) + outer(d, d)) * (t.area / area);
            normal_moment += (outer(t.normal, d) + outer(d, t.normal)) * (0.5 * t.area);
            let far = t.corners.iter().map(|c| c.distance(centre));
            radius = far.fold(radius, f64::max);
            cosine = cosine.min(t.normal.dot(axis));
        }
        let spread = if cosine > 0.0 {
            (1.0 - cosine * cosine).max(0.0).sqrt()
        } else {
            1.0
        };
        Self {
            centre,
            area_vector,
            covariance,
            normal_moment,
            radius,
            spread,
        }
    }

    /// The integral over the cluster seen from `p`, given `radial(u) = [G, G', G'']` at
    /// `u = |p - c| / xi`, to second order in the cluster's size:
    ///
    /// `G (r.N) + 1/2 [(G''/u^2 - G'/u^3) (r.Cr)(r.N) + (G'/u) (tr C (r.N) + 2 r.CN)]
    ///  - [G tr M + (G'/u) r.Mr]`.
    pub(crate) fn far_field<T>(&self, p: DVec3, xi: f64, radial: impl Fn(f64) -> [T; 3]) -> T
    where
        T: Copy
            + std::ops::Add<Output = T>
            + std::ops::Sub<Output = T>
            + std::ops::Mul<f64, Output = T>,
    {
        let r = (p - self.centre) / xi;
        let u = r.length();
        let [g, g1, g2] = radial(u);
        let c = self.covariance;
        let trace = |m: DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
        let (s, n) = (1.0 / (xi * xi), self.area_vector);
        let (rn, cr) = (r.dot(n), c * r);
        let curvature = r.dot(cr) * rn * s;
        let shape = (trace(c) * rn + 2.0 * cr.dot(n)) * s;
        let tilt = r.dot(self.normal_moment * r) / xi;
        let slope = g1 * (1.0 / u);
        let second = (g2 - slope) * (0.5 * curvature / (u * u)) + slope * (0.5 * shape);
        let turn = g * (trace(self.normal_moment) / xi) + slope * tilt;
        (g * rn + second - turn) * s
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Covariance of the uniform distribution on a triangle.
pub(crate) fn triangle_covariance(t: &Triangle) -> DMat3 {
    let square = |c: &DVec3| outer(*c - t.centroid, *c - t.centroid);
    (square(&t.corners[0]) + square(&t.corners[1]) + square(&t.corners[2])) * (1.0 / 12.0)
}
