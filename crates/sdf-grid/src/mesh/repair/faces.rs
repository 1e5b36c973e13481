//! Faces to drop: without area, or repeated.

use std::collections::HashMap;

use glam::DVec3;

use crate::mesh::topology::Topology;

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

/// Keeps the first of all faces with the same three corners, and none of those that form a wall
/// between two solids which touch; returns how many were dropped. Indices are below `vertices`.
pub(super) fn drop_duplicates(vertices: usize, triangles: &mut Vec<[u32; 3]>) -> usize {
    let before = triangles.len();
    // For each set of corners: the place of its first face, and by how much the faces of one
    // orientation outnumber those of the other.
    let mut seen: HashMap<[u32; 3], (usize, i32)> = HashMap::with_capacity(before);
    let mut kept = Vec::with_capacity(before);
    for &t in triangles.iter() {
        let (corners, sign) = sorted(t);
        let place = kept.len();
        let entry = seen.entry(corners).or_insert((place, 0));
        entry.1 += sign;
        if entry.0 == place {
            kept.push(t);
        }
    }
    if kept.len() < before {
        let mut cancels = vec![false; kept.len()];
        for (place, net) in seen.into_values() {
            cancels[place] = net == 0;
        }
        drop_walls(vertices, &mut kept, &cancels);
    }
    *triangles = kept;
    before - triangles.len()
}

/// The corners sorted by index, and the orientation of the face with respect to that order, 1 or -1.
fn sorted(t: [u32; 3]) -> ([u32; 3], i32) {
    let mut corners = t;
    corners.sort_unstable();
    let [a, b, _] = corners;
    let forward = (0..3).any(|i| t[i] == a && t[(i + 1) % 3] == b);
    (corners, if forward { 1 } else { -1 })
}

/// Drops patches of faces that had opposite copies (`cancels`) and end where two other faces meet: they
/// are both sides of a wall between solids that touch. Elsewhere opposite copies are a surface listed
/// for both sides, of which one stays.
fn drop_walls(vertices: usize, triangles: &mut Vec<[u32; 3]>, cancels: &[bool]) {
    let topology = Topology::new(triangles, vertices);
    let (of, count) = topology.components();
    let mut wall = vec![true; count];
    let mut ends = vec![false; count];
    for (face, &cancels) in cancels.iter().enumerate() {
        wall[of[face]] &= cancels;
    }
    for edge in topology.edges() {
        for half in edge.half_edges() {
            let patch = of[half.face()];
            wall[patch] &= !edge.is_open();
            ends[patch] |= edge.is_nonmanifold();
        }
    }
    let mut patches = of.into_iter();
    triangles.retain(|_| !patches.next().is_some_and(|p| wall[p] && ends[p]));
}
