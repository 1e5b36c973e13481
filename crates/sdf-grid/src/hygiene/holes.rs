//! How much of a surface is missing.

use std::collections::HashMap;

use glam::DVec3;

use crate::mesh::face_area;

/// Area of the fans that close the loops of `boundary` (directed edges of which as many enter each
/// vertex as leave it), each about the centroid of its loop's vertices.
///
/// A crack of no width, as between faces that share an edge but not its vertices, has no area.
pub(super) fn missing_area(vertices: &[DVec3], boundary: &[[u32; 2]]) -> f64 {
    loops(boundary)
        .iter()
        .map(|l| fan_area(l.iter().map(|&v| vertices[v as usize]).collect()))
        .sum()
}

fn fan_area(points: Vec<DVec3>) -> f64 {
    let center = points.iter().sum::<DVec3>() / points.len() as f64;
    (0..points.len())
        .map(|i| face_area([center, points[i], points[(i + 1) % points.len()]]))
        .sum()
}

/// Cuts a boundary into loops that visit no vertex twice.
fn loops(boundary: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[from, to] in boundary.iter().rev() {
        next.entry(from).or_default().push(to);
    }
    let mut found = Vec::new();
    for &[start, _] in boundary {
        let mut path = vec![start];
        let mut place: HashMap<u32, usize> = HashMap::from([(start, 0)]);
        // Each step uses up an edge; the walk ends where it began, when no edge leaves that vertex.
        while let Some(to) = path.last().and_then(|v| next.get_mut(v)?.pop()) {
            if let Some(&first) = place.get(&to) {
                found.push(path[first..].to_vec());
                for v in path.drain(first + 1..) {
                    place.remove(&v);
                }
            } else {
                place.insert(to, path.len());
                path.push(to);
            }
        }
    }
    found
}
