//! Areas and volumes of bare triangles.

use glam::DVec3;

use crate::mesh::aabb::Aabb;

/// Area of a triangle, in the squared unit of its corners.
pub(crate) fn face_area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Winding number of oriented triangles about a point: about 1 inside, 0 outside.
pub(crate) fn winding_number(triangles: impl Iterator<Item = [DVec3; 3]>, point: DVec3) -> f64 {
    let turns: f64 = triangles
        .map(|t| half_solid_angle(t.map(|p| p - point)))
        .sum();
    turns / (2.0 * std::f64::consts::PI)
}

/// Half the signed solid angle of a triangle seen from the origin (Van Oosterom and Strackee).
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    a.dot(b.cross(c)).atan2(denominator)
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
