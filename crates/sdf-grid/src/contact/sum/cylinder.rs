//! Regions that are cylinders, or parts of one.
//!
//! Seen from different places a torus fitted to facets differs by a part of what facets stray from
//! it, and the sum has a small step where a cluster moves from one cell to the next. A cylinder, the
//! commonest curved surface of parts that mate, is found as a whole instead.

use glam::{DMat3, DVec2, DVec3};

use super::osculating::{ALONG, MOST_BENT, OFF, Osculating, Surfel, solved};

/// How often the matrix of moments is squared to find the direction.
const SQUARINGS: usize = 20;

/// A cylinder; lengths are in units of the reach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cylinder {
    /// A point of its axis, and the direction.
    centre: DVec3,
    along: DVec3,
    radius: f64,
    /// One if its normals point outwards, else minus one.
    side: f64,
}

impl Cylinder {
    /// The one on which all of `surfels` lie.
    pub(super) fn fitted(surfels: &[Surfel]) -> Option<Self> {
        let along = across_all(surfels)?;
        let area: f64 = surfels.iter().map(|s| s.area).sum();
        let mean = surfels.iter().map(|s| s.area * s.place).sum::<DVec3>() / area;
        let (u, v) = along.any_orthonormal_pair();
        // x² + y² = a x + b y + c by least squares.
        let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
        for s in surfels {
            let p = s.place - mean;
            let p = DVec2::new(p.dot(u), p.dot(v));
            let row = [p.x, p.y, 1.0];
            for i in 0..3 {
                right[i] += s.area * row[i] * p.length_squared();
                for j in 0..3 {
                    normal[i][j] += s.area * row[i] * row[j];
                }
            }
        }
        let [a, b, c] = solved(normal, right)?;
        let centre = mean + 0.5 * (a * u + b * v);
        let radius = (c + 0.25 * (a * a + b * b)).sqrt();
        let out = |s: &Surfel| (s.place - centre).dot(s.normal) * s.area;
        let cylinder = Self {
            centre,
            along,
            // Surfels are bent: their middles lie below their surface.
            radius: radius + area / surfels.len() as f64 / (24.0 * radius),
            side: surfels.iter().map(out).sum::<f64>().signum(),
        };
        let on = |s: &Surfel| {
            let torus = cylinder.at(s.place);
            torus.is_some_and(|t| {
                (s.place - t.origin).length() <= OFF && t.axes[2].dot(s.normal) >= ALONG
            })
        };
        (radius * MOST_BENT >= 1.0 && surfels.iter().all(on)).then_some(cylinder)
    }

    /// The same at the point nearest to `p`, which is relative to `middle`, as is what comes back.
    pub(super) fn seen_from(&self, middle: DVec3, p: DVec3) -> Option<Osculating> {
        let torus = self.at(middle + p)?;
        Some(Osculating {
            origin: torus.origin - middle,
            ..torus
        })
    }

    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// The direction of its axis.
    #[cfg(test)]
    pub(super) fn along(&self) -> DVec3 {
        self.along
    }

    /// A place on it unrolled into a plane: along the circle, and along the axis.
    pub(super) fn unrolled(&self, p: DVec3) -> DVec2 {
        let (u, v) = self.along.any_orthonormal_pair();
        let from = p - self.centre;
        let angle = from.dot(v).atan2(from.dot(u));
        DVec2::new(self.radius * angle, from.dot(self.along))
    }

    fn at(&self, p: DVec3) -> Option<Osculating> {
        let from = p - self.centre;
        let height = from.dot(self.along);
        let out = (from - height * self.along).try_normalize()?;
        let normal = self.side * out;
        Some(Osculating {
            origin: self.centre + height * self.along + self.radius * out,
            axes: [self.along.cross(normal), self.along, normal],
            curvature: DVec2::new(self.side / self.radius, 0.0),
        })
    }
}

/// The direction across all normals: that of the least moment.
fn across_all(surfels: &[Surfel]) -> Option<DVec3> {
    let mut moments = DMat3::ZERO;
    for s in surfels {
        let n = s.normal;
        moments += DMat3::from_cols(n * n.x, n * n.y, n * n.z) * s.area;
    }
    let trace = moments.x_axis.x + moments.y_axis.y + moments.z_axis.z;
    let rest = DMat3::from_diagonal(DVec3::splat(trace)) - moments;
    let mut power = rest * (1.0 / trace);
    for _ in 0..SQUARINGS {
        power = power * power;
        let most = power.to_cols_array().into_iter().fold(0.0, f64::max);
        power *= 1.0 / most;
    }
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let longest = columns.into_iter().max_by(|a, b| {
        let [a, b] = [a, b].map(|c| c.length_squared());
        a.total_cmp(&b)
    });
    longest?.try_normalize()
}
