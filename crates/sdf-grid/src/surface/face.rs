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

/// Corners that make a [`Face`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    pub(crate) corners: [DVec3; 4],
    pub(crate) area: f64,
    count: u32,
    /// See [`Face::source`].
    pub(crate) source: u32,
}

impl Piece {
    /// None if the triangle has no area (to rounding) and therefore no normal.
    pub(crate) fn triangle(corners: [DVec3; 3], source: u32) -> Option<Self> {
        let [a, b, c] = corners;
        Self::new(3, [a, b, c, a], source)
    }

    /// A convex quadrangle, flat up to rounding; none if it or an edge of it has no extent.
    pub(crate) fn quadrangle(corners: [DVec3; 4], source: u32) -> Option<Self> {
        Self::new(4, corners, source)
    }

    fn new(count: u32, corners: [DVec3; 4], source: u32) -> Option<Self> {
        let piece = Self {
            corners,
            area: 0.0,
            count,
            source,
        };
        let edges = (0..piece.count()).map(|k| piece.edge(k).length_squared());
        let (longest, shortest) = edges.fold((0f64, f64::INFINITY), |(most, least), e| {
            (most.max(e), least.min(e))
        });
        let [a, b] = piece.halves();
        let twice_area = (a + b).length();
        let area = 0.5 * twice_area;
        let has_extent = twice_area > 1e-14 * longest && shortest > 0.0;
        has_extent.then_some(Self { area, ..piece })
    }

    /// Number of corners, 3 or 4.
    pub(crate) fn count(&self) -> usize {
        self.count as usize
    }

    /// Its corners, counter-clockwise seen from outside.
    pub(crate) fn outline(&self) -> &[DVec3] {
        &self.corners[..self.count()]
    }

    /// From corner `k` to the next.
    pub(crate) fn edge(&self, k: usize) -> DVec3 {
        let next = if k + 1 == self.count() { 0 } else { k + 1 };
        self.corners[next] - self.corners[k]
    }

    /// Twice the area vectors of its two triangles; of a triangle the second is nothing.
    fn halves(&self) -> [DVec3; 2] {
        let [a, b, c, d] = self.corners;
        // The fourth corner of a triangle is the first.
        [(b - a).cross(c - a), (c - a).cross(d - a)]
    }
}

impl Face {
    /// Unit normal and area of a triangle; none where [`Piece::triangle`] has none.
    pub(crate) fn normal_and_area([a, b, c]: [DVec3; 3]) -> Option<(DVec3, f64)> {
        let twice_area = (b - a).cross(c - a);
        let squares = [b - a, c - b, a - c].map(DVec3::length_squared);
        let longest = squares.into_iter().fold(0.0, f64::max);
        let length = twice_area.length();
        (length > 1e-14 * longest).then(|| (twice_area / length, 0.5 * length))
    }

    pub(crate) fn new(piece: &Piece) -> Self {
        let (count, corners) = (piece.count(), piece.corners);
        let edges = [0, 1, 2, 3].map(|k| piece.edge(k % count));
        let twice = piece.halves();
        let normal = (twice[0] + twice[1]).normalize();
        // Corners that a file has rounded leave the plane: edges are what is seen of them in it, so
        // that distances along and across them belong together.
        let flat = |edge: DVec3| edge - normal * edge.dot(normal);
        let edges = if count == 4 { edges.map(flat) } else { edges };
        let length = edges.map(DVec3::length);
        let along = [0, 1, 2, 3].map(|k| edges[k] / length[k]);
        let weights = twice.map(|t| t.dot(normal));
        let [a, b, c, d] = corners;
        let thirds = [(a + b + c) / 3.0, (a + c + d) / 3.0];
        let centroid =
            (thirds[0] * weights[0] + thirds[1] * weights[1]) / (weights[0] + weights[1]);
        Self {
            count,
            corners,
            normal,
            along,
            outward: along.map(|e| e.cross(normal)),
            length,
            area: piece.area,
            centroid,
            source: piece.source,
        }
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
