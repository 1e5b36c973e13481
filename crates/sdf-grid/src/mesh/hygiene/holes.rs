//! How much of a surface is missing.

use std::collections::HashMap;

use glam::DVec3;

use crate::mesh::measure::face_area;

/// Area of the fans that close the loops of `boundary` (directed edges of which as many enter each
/// vertex as leave it), each about the centroid of its loop's vertices.
///
/// Where loops touch, they are parted so that each turns back as sharply as it can: a crack of no
/// width, as between faces that meet along a line but do not share its vertices, has no area.
pub(super) fn missing_area(vertices: &[DVec3], boundary: &[[u32; 2]]) -> f64 {
    loops(vertices, boundary)
        .iter()
        .map(|l| fan_area(&l.iter().map(|&v| vertices[v as usize]).collect::<Vec<_>>()))
        .fold(0.0, |sum, area| sum + area)
}

fn fan_area(points: &[DVec3]) -> f64 {
    let center = points.iter().sum::<DVec3>() / points.len() as f64;
    (0..points.len())
        .map(|i| face_area([center, points[i], points[(i + 1) % points.len()]]))
        .sum()
}

/// Cuts a boundary into loops that visit no vertex twice.
fn loops(vertices: &[DVec3], boundary: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[from, to] in boundary {
        next.entry(from).or_default().push(to);
    }
    let mut found = Vec::new();
    for &[start, _] in boundary {
        let mut path = vec![start];
        let mut place: HashMap<u32, usize> = HashMap::from([(start, 0)]);
        // Each step uses up an edge; the walk ends where it began, when no edge leaves that vertex.
        while let Some(to) = sharpest(vertices, &path, &mut next) {
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

/// Takes the edge out of the end of `path` that turns back most sharply.
fn sharpest(vertices: &[DVec3], path: &[u32], next: &mut HashMap<u32, Vec<u32>>) -> Option<u32> {
    let &at = path.last()?;
    let ways = next.get_mut(&at)?;
    let position = |v: u32| vertices[v as usize];
    let back = match path {
        [.., from, _] => (position(*from) - position(at)).normalize_or_zero(),
        _ => DVec3::ZERO,
    };
    let turn = |&to: &u32| back.dot((position(to) - position(at)).normalize_or_zero());
    let best = (0..ways.len()).max_by(|&i, &j| turn(&ways[i]).total_cmp(&turn(&ways[j])))?;
    Some(ways.remove(best))
}
