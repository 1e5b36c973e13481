//! One flat face with the quantities every query needs.

use glam::DVec3;

/// A triangle or a convex quadrangle and its frame. Edge `k` runs from corner `k` to the next;
/// `outward[k]` lies in the plane, normal to edge `k`, pointing away from the face. Of a triangle,
/// the last entries repeat the first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Face {
    /// Number of corners, 3 or 4.
    pub(crate) count: usize,
    pub(crate) corners: [DVec3; 4],
    pub(crate) normal: DVec3,
    pub(crate) along: [DVec3; 4],
    pub(crate) outward: [DVec3; 4],
    pub(crate) length: [f64; 4],
    pub(crate) area: f64,
    pub(crate) centroid: DVec3,
    /// Index in the mesh of the triangle it is, or of one it is made of.
    pub(crate) source: u32,
}

impl Face {
    /// None if the triangle has no area (to rounding) and therefore no normal.
    pub(crate) fn triangle(corners: [DVec3; 3], source: u32) -> Option<Self> {
        let [a, b, c] = corners;
        Self::new(3, [a, b, c, a], source)
    }

    /// A convex quadrangle, flat up to rounding; none if it or an edge of it has no extent.
    pub(crate) fn quadrangle(corners: [DVec3; 4], source: u32) -> Option<Self> {
        Self::new(4, corners, source)
    }

    /// Unit normal and area of a triangle; none where [`Face::triangle`] has none.
    pub(crate) fn normal_and_area([a, b, c]: [DVec3; 3]) -> Option<(DVec3, f64)> {
        let twice_area = (b - a).cross(c - a);
        let squares = [b - a, c - b, a - c].map(DVec3::length_squared);
        let longest = squares.into_iter().fold(0.0, f64::max);
        let length = twice_area.length();
        (length > 1e-14 * longest).then(|| (twice_area / length, 0.5 * length))
    }

    fn new(count: usize, corners: [DVec3; 4], source: u32) -> Option<Self> {
        let at = |k: usize| corners[k % count];
        let edges = [0, 1, 2, 3].map(|k| at(k + 1) - at(k));
        let length = edges.map(DVec3::length);
        let halves = [[at(0), at(1), at(2)], [at(0), at(2), at(3)]];
        let twice = halves.map(|[a, b, c]| (b - a).cross(c - a));
        let twice_area = twice[0] + if count == 4 { twice[1] } else { DVec3::ZERO };
        let longest = length.into_iter().fold(0.0, f64::max);
        let shortest = length.into_iter().fold(f64::INFINITY, f64::min);
        if twice_area.length() <= 1e-14 * longest * longest || shortest == 0.0 {
            return None;
        }
        let normal = twice_area.normalize();
        // Corners that a file has rounded leave the plane: edges are what is seen of them in it, so that
        // distances along and across them belong together.
        let flat = |edge: DVec3| edge - normal * edge.dot(normal);
        let edges = if count == 4 { edges.map(flat) } else { edges };
        let length = edges.map(DVec3::length);
        let along = edges.map(DVec3::normalize);
        let weights = [
            twice[0].dot(normal),
            if count == 4 {
                twice[1].dot(normal)
            } else {
                0.0
            },
        ];
        let thirds = halves.map(|[a, b, c]| (a + b + c) / 3.0);
        let centroid =
            (thirds[0] * weights[0] + thirds[1] * weights[1]) / (weights[0] + weights[1]);
        Some(Self {
            count,
            corners,
            normal,
            along,
            outward: along.map(|e| e.cross(normal)),
            length,
            area: 0.5 * twice_area.length(),
            centroid,
            source,
        })
    }

    /// Its corners, counter-clockwise seen from outside.
    pub(crate) fn outline(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// The triangles it consists of.
    pub(crate) fn fan(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        (2..self.count).map(|k| [self.corners[0], self.corners[k - 1], self.corners[k]])
    }

    /// Signed height of `p` above the plane.
    pub(crate) fn height(&self, p: DVec3) -> f64 {
        (p - self.corners[0]).dot(self.normal)
    }

    /// The closest point of the face to `p`.
    pub(crate) fn closest(&self, p: DVec3) -> DVec3 {
        let foot = p - self.normal * self.height(p);
        let mut inside = true;
        let (mut best, mut best_distance) = (foot, f64::INFINITY);
        for k in 0..self.count {
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
        for k in 0..self.count {
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
        let height = self.height(p);
        let half = |[a, b, c]: [DVec3; 3]| {
            let numerator = height * (b - a).cross(c - a).dot(self.normal);
            let [a, b, c] = [a - p, b - p, c - p];
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            numerator.atan2(denominator)
        };
        2.0 * self.fan().map(half).sum::<f64>()
    }
}
