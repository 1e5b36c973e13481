//! Convex polygons of few corners, cut by planes.

use glam::DVec3;

/// Most corners: a triangle cut by the six sides of a box has nine, and rounding may add some.
const CORNERS: usize = 20;

/// A flat convex polygon.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Polygon {
    corners: [DVec3; CORNERS],
    count: usize,
}

impl Polygon {
    const EMPTY: Self = Self {
        corners: [DVec3::ZERO; CORNERS],
        count: 0,
    };

    pub(crate) fn triangle(corners: [DVec3; 3]) -> Self {
        let mut polygon = Self::EMPTY;
        corners.into_iter().for_each(|p| polygon.push(p));
        polygon
    }

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// A corner equal to the one before, or one more than there is room for, is left out: both
    /// come from rounding.
    fn push(&mut self, p: DVec3) {
        let again = self.count > 0 && self.corners[self.count - 1] == p;
        if !again && self.count < CORNERS {
            self.corners[self.count] = p;
            self.count += 1;
        }
    }

    /// What lies behind and before the zero of a linear function, given at every point; a side
    /// without area is none. A polygon nowhere farther than `flat` from the zero is before it.
    pub(crate) fn split(
        &self,
        height: impl Fn(DVec3) -> f64,
        flat: f64,
    ) -> (Option<Self>, Option<Self>) {
        let heights = self.corners.map(height);
        let heights = &heights[..self.count];
        if heights.iter().all(|h| *h >= -flat) {
            return (None, Some(*self));
        }
        if heights.iter().all(|h| *h <= flat) {
            return (Some(*self), None);
        }
        let (mut behind, mut before) = (Self::EMPTY, Self::EMPTY);
        for i in 0..self.count {
            let j = (i + 1) % self.count;
            let (p, q, a, b) = (self.corners[i], self.corners[j], heights[i], heights[j]);
            if a <= 0.0 {
                behind.push(p);
            }
            if a >= 0.0 {
                before.push(p);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                let cut = p + (q - p) * (a / (a - b));
                behind.push(cut);
                before.push(cut);
            }
        }
        (behind.if_whole(), before.if_whole())
    }

    fn if_whole(self) -> Option<Self> {
        (self.count >= 3).then_some(self)
    }

    /// Points and weights (square metres) of a rule that is exact for quadratic functions.
    pub(crate) fn quadrature(&self, mut add: impl FnMut(DVec3, f64)) {
        let corners = self.corners();
        for pair in corners[1..].windows(2) {
            let [a, b, c] = [corners[0], pair[0], pair[1]];
            let third = (b - a).cross(c - a).length() / 6.0;
            if third > 0.0 {
                for p in [a, b, c] {
                    add((a + b + c + p * 3.0) / 6.0, third);
                }
            }
        }
    }

    pub(crate) fn centroid(&self) -> DVec3 {
        self.corners().iter().sum::<DVec3>() / self.count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(polygon: &Polygon, f: impl Fn(DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        polygon.quadrature(|p, w| sum += w * f(p));
        sum
    }

    #[test]
    fn parts_of_a_cut_triangle_make_the_whole() {
        let whole = Polygon::triangle([DVec3::ZERO, DVec3::new(3.0, 0.5, 1.0), DVec3::Y * 2.0]);
        let height = |p: DVec3| p.dot(DVec3::new(0.3, 0.8, -0.2)) - 0.5;
        let (behind, before) = whole.split(height, 0.0);
        let (behind, before) = (behind.unwrap(), before.unwrap());
        for f in [
            |_: DVec3| 1.0,
            |p: DVec3| p.x,
            |p: DVec3| p.y * p.z,
            |p: DVec3| p.x * p.x,
        ] {
            let sum = moments(&behind, f) + moments(&before, f);
            assert!((sum - moments(&whole, f)).abs() < 1e-12);
        }
        assert!(behind.corners().iter().all(|p| height(*p) < 1e-12));
        assert!(before.corners().iter().all(|p| height(*p) > -1e-12));
    }

    #[test]
    fn a_polygon_in_the_plane_is_not_cut() {
        let flat = Polygon::triangle([DVec3::ZERO, DVec3::X, DVec3::Y + DVec3::Z * 1e-12]);
        let (behind, before) = flat.split(|p| p.z, 1e-10);
        assert!(behind.is_none() && before.is_some());
    }
}
