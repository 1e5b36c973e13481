//! Faces that say nothing: without area, or said before.

use std::collections::HashMap;

use glam::DVec3;

/// A face whose height is below this fraction of the mesh's diagonal has no area: its normal is
/// rounding noise in single precision.
const ZERO_HEIGHT: f64 = 1e-9;

/// Drops faces with repeated corners or no height; also returns how many.
pub(super) fn drop_zero_area(
    vertices: &[DVec3],
    mut triangles: Vec<[u32; 3]>,
    diagonal: f64,
) -> (Vec<[u32; 3]>, usize) {
    let before = triangles.len();
    triangles.retain(|t| height(t.map(|v| vertices[v as usize])) > ZERO_HEIGHT * diagonal);
    let dropped = before - triangles.len();
    (triangles, dropped)
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

/// Keeps the first of all faces with the same three corners; also returns how many were dropped.
pub(super) fn drop_duplicates(mut triangles: Vec<[u32; 3]>) -> (Vec<[u32; 3]>, usize) {
    let before = triangles.len();
    let mut seen = HashMap::with_capacity(before);
    triangles.retain(|t| {
        let mut corners = *t;
        corners.sort_unstable();
        seen.insert(corners, ()).is_none()
    });
    let dropped = before - triangles.len();
    (triangles, dropped)
}
