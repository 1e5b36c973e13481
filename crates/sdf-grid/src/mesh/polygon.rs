//! Cutting polygons into triangles.

use std::collections::HashSet;

use earcut::Earcut;
use glam::{DVec2, DVec3};
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation,
};

/// Cuts a polygon with holes (each listed either way round, no corner repeated at the end) into
/// triangles of indices into outline and holes chained together, counter-clockwise. Corners on a
/// straight side may be left out. `None` if the polygon crosses itself or has no area.
pub fn triangulate(outline: &[DVec2], holes: &[Vec<DVec2>]) -> Option<Vec<[u32; 3]>> {
    let mut points: Vec<[f64; 2]> = outline.iter().map(|p| p.to_array()).collect();
    let mut starts = Vec::with_capacity(holes.len());
    for hole in holes {
        starts.push(points.len() as u32);
        points.extend(hole.iter().map(|p| p.to_array()));
    }
    let mut indices: Vec<u32> = Vec::new();
    Earcut::new().earcut(points.iter().copied(), &starts, &mut indices);
    let (cuts, _) = indices.as_chunks::<3>();
    let corner = |i: u32| DVec2::from_array(points[i as usize]);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        0.5 * (b - a).perp_dot(c - a)
    };
    let expected =
        signed_area(outline).abs() - holes.iter().map(|h| signed_area(h).abs()).sum::<f64>();
    let covered: f64 = cuts.iter().map(|t| area(t).abs()).sum();
    if !(expected > 0.0 && (covered - expected).abs() <= 1e-9 * expected) {
        return None;
    }
    let upward = |&[a, b, c]: &[u32; 3]| {
        if area(&[a, b, c]) < 0.0 {
            [a, c, b]
        } else {
            [a, b, c]
        }
    };
    Some(cuts.iter().map(upward).collect())
}

/// Cuts the region within rings (the outline and the holes as places among `points`, any way round)
/// into triangles that are as little drawn out as its sides allow, which are not cut; adds corners
/// inside it for that. Corners (the given ones first) and triangles of their indices,
/// counter-clockwise. Rings may touch in corners; `None` if they cross or points coincide.
pub(crate) fn triangulate_compactly(points: &[DVec2], rings: &[Vec<u32>]) -> Option<Triangles> {
    let mut delaunay = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(points.len());
    for (place, p) in points.iter().enumerate() {
        let handle = delaunay.insert(Point2::new(p.x, p.y)).ok()?;
        // A corner that was there before gets its old index.
        if handle.index() != place {
            return None;
        }
        handles.push(handle);
    }
    for ring in rings {
        for (k, &from) in ring.iter().enumerate() {
            let to = ring[(k + 1) % ring.len()];
            let [from, to] = [from, to].map(|v| handles[v as usize]);
            if !delaunay.can_add_constraint(from, to) {
                return None;
            }
            delaunay.add_constraint(from, to);
        }
    }
    let given = points.len();
    let limits = RefinementParameters::new()
        .exclude_outer_faces(true)
        .with_angle_limit(AngleLimit::from_deg(COMPACT))
        .with_max_additional_vertices(MOST_ADDED * given);
    let outer = delaunay.refine(limits).excluded_faces;
    let outer: HashSet<_> = outer.into_iter().collect();
    let corners = delaunay.vertices().map(|v| {
        let p = v.position();
        DVec2::new(p.x, p.y)
    });
    let faces = delaunay.inner_faces().filter(|f| !outer.contains(&f.fix()));
    let cuts = faces.map(|f| f.vertices().map(|v| v.fix().index() as u32));
    Some((corners.collect(), cuts.collect()))
}

/// Corners, and triangles of their indices.
type Triangles = (Vec<DVec2>, Vec<[u32; 3]>);

/// Least angle of triangles to aim at, degrees.
const COMPACT: f64 = 20.0;

/// Corners that may be added per corner given.
const MOST_ADDED: usize = 4;

/// Area of a polygon, positive if its corners run counter-clockwise.
pub(crate) fn signed_area(polygon: &[DVec2]) -> f64 {
    let Some(&first) = polygon.first() else {
        return 0.0;
    };
    polygon
        .windows(2)
        .map(|w| 0.5 * (w[0] - first).perp_dot(w[1] - first))
        .sum()
}

/// Cuts a polygon in space into triangles of indices into `points`, running as the polygon does.
/// A convex one becomes a fan, and so does one with corners that are not finite, for repair to
/// refuse. `None` if it crosses itself or has no area.
pub(crate) fn triangulate_in_space(points: &[DVec3]) -> Option<Vec<[u32; 3]>> {
    let first = *points.first()?;
    let normal: DVec3 = points
        .windows(2)
        .map(|w| (w[0] - first).cross(w[1] - first))
        .sum();
    let fan: Vec<[u32; 3]> = (2..points.len() as u32).map(|i| [0, i - 1, i]).collect();
    let convex = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| points[i as usize]);
        (b - a).cross(c - a).dot(normal) >= 0.0
    };
    if !normal.is_finite() || fan.iter().all(convex) {
        return Some(fan);
    }
    let (u, v) = normal.try_normalize()?.any_orthonormal_pair();
    let flat: Vec<DVec2> = points
        .iter()
        .map(|&p| DVec2::new((p - first).dot(u), (p - first).dot(v)))
        .collect();
    triangulate(&flat, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half: f64) -> Vec<DVec2> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| half * DVec2::new(x, y))
            .to_vec()
    }

    #[test]
    fn square_with_square_hole_has_eight_triangles() {
        let cut = triangulate(&square(2.0), &[square(1.0)]).expect("simple polygon");
        assert_eq!(cut.len(), 8);
    }

    #[test]
    fn a_bow_tie_is_refused() {
        let tie = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| DVec2::new(x, y));
        assert_eq!(triangulate(&tie, &[]), None);
    }

    #[test]
    fn a_concave_polygon_in_space_keeps_its_area_and_direction() {
        // An L in the plane x = 3, corners running clockwise seen from +x.
        let outline = [
            (0.0, 0.0),
            (0.0, 2.0),
            (1.0, 2.0),
            (1.0, 1.0),
            (3.0, 1.0),
            (3.0, 0.0),
        ];
        let points = outline.map(|(y, z)| DVec3::new(3.0, y, z));
        let cut = triangulate_in_space(&points).expect("simple polygon");
        let area: DVec3 = cut
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| points[i as usize]);
                0.5 * (b - a).cross(c - a)
            })
            .sum();
        assert!((area.x + 4.0).abs() <= 4e-12);
    }
}
