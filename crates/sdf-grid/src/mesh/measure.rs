//! Areas and volumes of bare triangles.

use glam::DVec3;

use crate::mesh::aabb::Aabb;

/// Area of a triangle, in the squared unit of its corners.
pub(crate) fn face_area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Volume enclosed by `triangles`, seen from the centre of their bounds so that a part far from
/// the origin loses no digits.
pub(crate) fn volume(vertices: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let center = Aabb::around(triangles.iter().flat_map(corners)).center();
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = corners(t).map(|p| p - center);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
