//! One triangle with the quantities every query needs.

use glam::DVec3;

/// A triangle and its frame. Edge `k` runs from corner `k` to corner `k + 1`; `outward[k]` lies in
/// the plane, normal to edge `k`, pointing away from the triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Triangle {
    pub(crate) corners: [DVec3; 3],
    pub(crate) normal: DVec3,
    pub(crate) along: [DVec3; 3],
    pub(crate) outward: [DVec3; 3],
    pub(crate) length: [f64; 3],
    pub(crate) area: f64,
    pub(crate) centroid: DVec3,
    /// Largest distance of a corner from the centroid.
    pub(crate) radius: f64,
    /// Index in the mesh.
    pub(crate) source: u32,
}

impl Triangle {
    /// None if the triangle has no area (to rounding) and therefore no normal.
    pub(crate) fn new(corners: [DVec3; 3], source: u32) -> Option<Self> {
        let edges = [0, 1, 2].map(|k| corners[(k + 1) % 3] - corners[k]);
        let length = edges.map(DVec3::length);
        let twice_area = edges[0].cross(corners[2] - corners[0]);
        let longest = length[0].max(length[1]).max(length[2]);
        if twice_area.length() <= 1e-14 * longest * longest {
            return None;
        }
        let normal = twice_area.normalize();
        let along = edges.map(DVec3::normalize);
        let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners
            .iter()
            .map(|c| c.distance(centroid))
            .fold(0.0, f64::max);
        Some(Self {
            corners,
            normal,
            along,
            outward: along.map(|e| e.cross(normal)),
            length,
            area: 0.5 * twice_area.length(),
            centroid,
            radius,
            source,
        })
    }

    /// Signed height of `p` above the plane.
    pub(crate) fn height(&self, p: DVec3) -> f64 {
        (p - self.corners[0]).dot(self.normal)
    }

    /// The closest point of the triangle to `p`.
    pub(crate) fn closest(&self, p: DVec3) -> DVec3 {
        let foot = p - self.normal * self.height(p);
        let mut inside = true;
        let (mut best, mut best_distance) = (foot, f64::INFINITY);
        for k in 0..3 {
            let from = foot - self.corners[k];
            inside &= from.dot(self.outward[k]) <= 0.0;
            let t = from.dot(self.along[k]).clamp(0.0, self.length[k]);
            let q = self.corners[k] + self.along[k] * t;
            let d = q.distance_squared(foot);
            if d < best_distance {
                (best, best_distance) = (q, d);
            }
        }
        if inside { foot } else { best }
    }

    /// Squared distance from `p`.
    pub(crate) fn distance_squared(&self, p: DVec3) -> f64 {
        let height = self.height(p);
        let mut inside = true;
        let mut best = f64::INFINITY;
        for k in 0..3 {
            let from = p - self.corners[k];
            let out = from.dot(self.outward[k]);
            let t = from.dot(self.along[k]);
            inside &= out <= 0.0;
            let beyond = t - t.clamp(0.0, self.length[k]);
            best = best.min(out * out + beyond * beyond);
        }
        height * height + if inside { 0.0 } else { best }
    }

    /// Signed solid angle seen from `p`, steradians: positive on the side of the normal
    /// (van Oosterom and Strackee).
    pub(crate) fn solid_angle(&self, p: DVec3) -> f64 {
        let [a, b, c] = self.corners.map(|q| q - p);
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let numerator = self.height(p) * 2.0 * self.area;
        let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * numerator.atan2(denominator)
    }
}
