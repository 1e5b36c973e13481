//! Sharp edges and corners of a part, and the densities about them.
//!
//! The density does not change when a part is scaled. Near an edge, as long as no other feature is
//! within the kernel's reach, it therefore depends only on the direction from the edge, and near a
//! corner on that from the corner: it is discontinuous there and no polynomial fits it. Within a
//! small tube about each edge (a ball about each corner) it is read at the tube's surface instead.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use sdf_grid::TriangleMesh;

use crate::geometry::facet::Faces;

/// Planes whose normals are nearer than this (20 degrees) make no sharp edge, edges whose directions
/// are, no corner.
const SHARP: f64 = 0.94;

/// The ball about a corner, in radii of the tubes.
const BALL: f64 = 1.25;

/// How far from a cell edges are listed, in radii of the tubes.
const LISTED: f64 = 3.0;

/// The sharp edges of a part.
#[derive(Debug, Clone)]
pub(crate) struct SharpEdges {
    pub(crate) segments: Vec<Segment>,
    corners: Vec<DVec3>,
    /// Radius of the tubes, metres.
    tube: f64,
}

/// A straight piece of an edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    start: DVec3,
    along: DVec3,
    length: f64,
}

/// Edges and corners near a cell.
#[derive(Debug, Clone, Default)]
pub(super) struct Near {
    segments: Vec<u32>,
    corners: Vec<u32>,
}

impl Segment {
    /// Its point nearest to `p`, and whether that is an end.
    fn foot(&self, p: DVec3) -> (DVec3, bool) {
        let t = (p - self.start).dot(self.along);
        let inside = t.clamp(0.0, self.length);
        (self.start + self.along * inside, t != inside)
    }

    /// From its nearest point to `p`.
    pub(crate) fn offset(&self, p: DVec3) -> DVec3 {
        p - self.foot(p).0
    }
}

impl Near {
    pub(super) fn is_empty(&self) -> bool {
        self.segments.is_empty() && self.corners.is_empty()
    }
}

impl SharpEdges {
    /// The edges of a mesh with tubes of radius `tube`, metres.
    pub(crate) fn new(mesh: &TriangleMesh, faces: &Faces, tube: f64) -> Self {
        let mut planes: HashMap<(u32, u32), u32> = HashMap::new();
        let mut ends = Vec::new();
        for (plane, triangle) in faces.triangles(mesh) {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let other = planes.insert((a.min(b), a.max(b)), plane);
                let normal = |p: u32| faces.planes[p as usize].normal;
                if other.is_some_and(|o| normal(o).dot(normal(plane)) < SHARP) {
                    ends.push((a, b));
                }
            }
        }
        let point = |v: u32| mesh.vertices()[v as usize];
        let mut at: HashMap<u32, Vec<DVec3>> = HashMap::new();
        let mut segments = Vec::new();
        for (a, b) in ends {
            let along = (point(b) - point(a)).normalize_or_zero();
            at.entry(a).or_default().push(along);
            at.entry(b).or_default().push(-along);
            segments.push(Segment {
                start: point(a),
                along,
                length: point(a).distance(point(b)),
            });
        }
        let passes = |d: &[DVec3]| d.len() == 2 && d[0].dot(d[1]) < -SHARP;
        let corners = at.into_iter().filter(|(_, d)| !passes(d));
        let mut corners: Vec<u32> = corners.map(|(v, _)| v).collect();
        corners.sort_unstable();
        Self {
            segments,
            corners: corners.into_iter().map(point).collect(),
            tube,
        }
    }

    pub(super) fn all(&self) -> Near {
        Near {
            segments: (0..self.segments.len() as u32).collect(),
            corners: (0..self.corners.len() as u32).collect(),
        }
    }

    /// Those of `near` that lie near a cell.
    pub(super) fn near(&self, near: &Near, centre: DVec3, radius: f64) -> Near {
        let reach = LISTED * self.tube + radius;
        let segments = near.segments.iter().copied();
        let corners = near.corners.iter().copied();
        let distance = |s: u32| self.segments[s as usize].offset(centre).length();
        Near {
            segments: segments.filter(|s| distance(*s) < reach).collect(),
            corners: corners
                .filter(|c| centre.distance(self.corners[*c as usize]) < reach)
                .collect(),
        }
    }

    /// Whether a ball around `p` lies in a tube or a corner's ball: nothing is read there.
    pub(super) fn covers(&self, near: &Near, p: DVec3, radius: f64) -> bool {
        let mut segments = near.segments.iter().map(|s| &self.segments[*s as usize]);
        let mut corners = near.corners.iter().map(|c| self.corners[*c as usize]);
        segments.any(|s| s.offset(p).length() + radius < self.tube)
            || corners.any(|c| c.distance(p) + radius < BALL * self.tube)
    }

    /// Whether an edge comes into the ball around a cube.
    pub(super) fn crosses(&self, near: &Near, centre: DVec3, half: f64) -> bool {
        let mut segments = near.segments.iter().map(|s| &self.segments[*s as usize]);
        segments.any(|s| s.offset(centre).length() < half * 3f64.sqrt())
    }

    /// Where the density of a point in a tube is read, and the derivative of that place with respect
    /// to the point; none where it is read at the point itself.
    pub(super) fn outward(&self, near: &Near, p: DVec3) -> Option<(DVec3, DMat3)> {
        let mut place = (p, DMat3::IDENTITY);
        let mut moved = false;
        let corners = near.corners.iter().map(|c| self.corners[*c as usize]);
        let distance = |c: &DVec3| c.distance_squared(p);
        if let Some(corner) = corners.min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            moved |= push(&mut place, corner, None, BALL * self.tube);
        }
        // Away from one edge may be towards another, where they meet.
        for _ in 0..2 {
            let segments = near.segments.iter().map(|s| &self.segments[*s as usize]);
            let squared = |s: &&Segment| s.offset(place.0).length_squared();
            let Some(segment) = segments.min_by(|a, b| squared(a).total_cmp(&squared(b))) else {
                break;
            };
            let (foot, at_end) = segment.foot(place.0);
            let along = (!at_end).then_some(segment.along);
            moved |= push(&mut place, foot, along, self.tube);
        }
        moved.then_some(place)
    }
}

/// Moves a place nearer than `radius` straight away from `from`, its foot on an edge along `along`
/// if that is given; whether it was nearer.
fn push(place: &mut (DVec3, DMat3), from: DVec3, along: Option<DVec3>, radius: f64) -> bool {
    let offset = place.0 - from;
    let distance = offset.length().max(1e-6 * radius);
    if distance >= radius {
        return false;
    }
    let (ratio, e) = (radius / distance, offset / distance);
    let outer = |v: DVec3| DMat3::from_cols(v * v.x, v * v.y, v * v.z);
    let kept = along.map_or(DMat3::ZERO, outer);
    let change = kept + (DMat3::IDENTITY - kept - outer(e)) * ratio;
    *place = (from + offset * ratio, change * place.1);
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdf_grid::shapes::PegInHole;

    fn edges(which: PegInHole) -> SharpEdges {
        let (_, peg) = which.pair(0.0).unwrap();
        SharpEdges::new(&peg, &Faces::new(&peg), 1e-3)
    }

    #[test]
    fn a_box_has_twelve_edges_and_eight_corners_and_a_cylinder_two_rims() {
        let square = edges(PegInHole::Rectangular);
        assert_eq!((square.segments.len(), square.corners.len()), (12, 8));
        let round = edges(PegInHole::Circular);
        assert_eq!((round.segments.len(), round.corners.len()), (2 * 96, 0));
    }

    #[test]
    fn places_lie_on_the_tube_and_change_as_said() {
        let edges = edges(PegInHole::Rectangular);
        let near = edges.all();
        let corner = DVec3::new(0.01, 0.01, 0.015);
        for offset in [
            DVec3::new(2e-4, -3e-4, -5e-3),
            DVec3::new(-1e-4, 5e-4, 3e-4),
            DVec3::new(-6e-4, -4e-4, -1.9e-3),
        ] {
            let p = corner + offset;
            let (place, change) = edges.outward(&near, p).unwrap();
            let radii = edges.segments.iter().map(|s| s.offset(place).length());
            assert!(radii.fold(f64::INFINITY, f64::min) > 0.99e-3);
            for axis in 0..3 {
                let mut step = DVec3::ZERO;
                step[axis] = 1e-9;
                let at = |s: f64| edges.outward(&near, p + step * s).unwrap().0;
                let slope = (at(1.0) - at(-1.0)) / 2e-9;
                assert!(slope.distance(change.col(axis)) < 1e-5 * (1.0 + slope.length()));
            }
        }
        assert!(edges.outward(&near, DVec3::ZERO).is_none());
    }
}
