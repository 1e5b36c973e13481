//! Faces that say nothing: without area, or said before.

use std::collections::HashSet;

use glam::DVec3;

/// A face whose height is below this fraction of the mesh's diagonal has no area: its normal is
/// rounding noise in single precision.
const ZERO_HEIGHT: f64 = 1e-9;

/// Drops faces with repeated corners or no height; returns how many.
pub(super) fn drop_zero_area(
    vertices: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
    diagonal: f64,
) -> usize {
    let before = triangles.len();
    triangles.retain(|t| height(t.map(|v| vertices[v as usize])) > ZERO_HEIGHT * diagonal);
    before - triangles.len()
}

/// Height of a triangle over its longest edge; 0 if its corners coincide.
fn height([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = [a.distance(b), b.distance(c), c.distance(a)]
        .into_iter()
        .fold(0.0, f64::max);
    if longest > 0.0 {
        (b - a).cross(c - a).length() / longest
    } else {
        0.0
    }
}

/// Keeps the first of all faces with the same three corners; returns how many were dropped.
pub(super) fn drop_duplicates(triangles: &mut Vec<[u32; 3]>) -> usize {
    let before = triangles.len();
    let mut seen = HashSet::with_capacity(before);
    triangles.retain(|t| {
        let mut corners = *t;
        corners.sort_unstable();
        seen.insert(corners)
    });
    before - triangles.len()
}
