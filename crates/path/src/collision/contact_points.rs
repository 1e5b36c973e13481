//! Points of a surface that touch first: along edges that point outwards, and a few on faces.

use std::collections::HashMap;

use glam::DVec3;
use sdf_grid::TriangleMesh;

/// Faces that turn by less than this, radians, have no edge between them.
const FLAT: f64 = 1e-4;
/// Edges that turn by less than this, radians, are blunt: their points lie [`SPARSE`] times as far
/// apart.
const BLUNT: f64 = 0.5;
const SPARSE: f64 = 4.0;
/// Points on faces lie so many times as far apart as those along edges.
const FACES: f64 = 8.0;
/// Most points of a surface: the spacing grows until they are no more.
const MOST: usize = 200_000;

/// Points on the surface of `mesh`, metres, no farther apart along sharp convex edges than `spacing`,
/// and on blunt ones than [`SPARSE`] times it. Two solids that meet do so in a convex vertex or edge of
/// one of them, unless they meet flat.
pub(crate) fn contact_points(mesh: &TriangleMesh, spacing: f64) -> Vec<DVec3> {
    let edges = convex_edges(mesh);
    let mut spacing = spacing;
    while count(mesh, &edges, spacing) > MOST {
        spacing *= 2.0;
    }
    let mut points = Points::new(SPARSE * spacing);
    for ([a, b], angle) in &edges {
        let [a, b] = [a, b].map(|v| mesh.vertices()[*v as usize]);
        let parts = parts(a.distance(b), spacing_of(spacing, *angle));
        let along = (0..=parts).map(|i| a.lerp(b, i as f64 / parts as f64));
        along.for_each(|p| points.add(p, *angle >= BLUNT));
    }
    for [a, b, c] in mesh.faces() {
        let parts = face_parts([a, b, c], spacing);
        if parts == 1 {
            continue;
        }
        // Centroids of the upright ones among parts² smaller triangles.
        for i in 0..parts {
            for j in 0..parts - i {
                let at = |k: usize| (k as f64 + 1.0 / 3.0) / parts as f64;
                points.add(a + at(i) * (b - a) + at(j) * (c - a), false);
            }
        }
    }
    points.taken()
}

/// Points, the blunt ones at most one to a cell.
struct Points {
    cell: f64,
    sharp: Vec<DVec3>,
    blunt: HashMap<[i64; 3], DVec3>,
}

impl Points {
    fn new(cell: f64) -> Self {
        Self {
            cell,
            sharp: Vec::new(),
            blunt: HashMap::new(),
        }
    }

    fn add(&mut self, p: DVec3, sharp: bool) {
        match sharp {
            true => self.sharp.push(p),
            false => {
                let cell = (p / self.cell).floor().to_array().map(|x| x as i64);
                self.blunt.entry(cell).or_insert(p);
            }
        }
    }

    /// All of them, each once, in an order that depends on nothing else.
    fn taken(mut self) -> Vec<DVec3> {
        self.sharp.extend(self.blunt.into_values());
        let order = |a: &DVec3, b: &DVec3| {
            let [a, b] = [a, b].map(|p| p.to_array());
            let unequal = a.iter().zip(&b).map(|(x, y)| x.total_cmp(y));
            unequal.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        };
        self.sharp.sort_by(order);
        self.sharp.dedup();
        self.sharp
    }
}

fn spacing_of(spacing: f64, angle: f64) -> f64 {
    if angle < BLUNT {
        SPARSE * spacing
    } else {
        spacing
    }
}

fn parts(length: f64, spacing: f64) -> usize {
    (length / spacing).ceil().clamp(1.0, MOST as f64) as usize
}

fn face_parts([a, b, c]: [DVec3; 3], spacing: f64) -> usize {
    // Of narrow faces the edges are enough.
    parts((b - a).cross(c - a).length().sqrt(), FACES * spacing)
}

/// A lower bound of the number of points.
fn count(mesh: &TriangleMesh, edges: &[([u32; 2], f64)], spacing: f64) -> usize {
    let along = edges.iter().map(|([a, b], angle)| {
        let [a, b] = [a, b].map(|v| mesh.vertices()[*v as usize]);
        parts(a.distance(b), spacing_of(spacing, *angle)) + 1
    });
    let across = mesh.faces().map(|f| face_parts(f, spacing).pow(2) / 2);
    along.chain(across).fold(0, usize::saturating_add)
}

/// Edges at which the surface turns outwards, with the angle by which it does, radians.
fn convex_edges(mesh: &TriangleMesh) -> Vec<([u32; 2], f64)> {
    let normal = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut first: HashMap<(u32, u32), usize> = HashMap::new();
    let mut edges = Vec::new();
    for (i, t) in mesh.triangles().iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let Some(other) = first.insert((a.min(b), a.max(b)), i) else {
                continue;
            };
            let along = mesh.vertices()[b as usize] - mesh.vertices()[a as usize];
            let (own, other) = (normal(i), normal(other));
            let angle = own.angle_between(other);
            if angle > FLAT && own.cross(other).dot(along) > 0.0 {
                edges.push(([a, b], angle));
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use sdf_grid::shapes;
    use sdf_grid::shapes::PegInHole;

    use super::*;

    #[test]
    fn points_lie_along_convex_edges_and_sparsely_on_faces() {
        let cube = shapes::cuboid(DVec3::splat(0.01)).unwrap();
        let points = contact_points(&cube, 0.001);
        let extreme = |p: &DVec3| {
            p.abs()
                .to_array()
                .iter()
                .filter(|x| **x > 0.005 - 1e-12)
                .count()
        };
        assert_eq!(points.iter().filter(|p| extreme(p) == 3).count(), 8);
        assert_eq!(points.iter().filter(|p| extreme(p) == 2).count(), 12 * 9);
        assert!(points.iter().any(|p| extreme(p) == 1));
        assert!(points.iter().all(|p| extreme(p) > 0));
    }

    /// Of a hole the mouth counts, the corners inside do not.
    #[test]
    fn edges_that_point_inwards_have_no_points() {
        let (hole, _) = PegInHole::Rectangular.pair(0.0).unwrap();
        let points = contact_points(&hole, 0.002);
        let on_inner_corner = |p: &&DVec3| {
            p.x.abs() < 0.0101
                && p.y.abs() < 0.0101
                && p.z.abs() < 0.0149
                && (p.x.abs() - p.y.abs()).abs() < 1e-6
        };
        assert_eq!(points.iter().filter(on_inner_corner).count(), 0);
        let on_mouth = |p: &&DVec3| p.z > 0.0149 && p.x.abs().max(p.y.abs()) < 0.01 + 1e-9;
        assert!(points.iter().filter(on_mouth).count() >= 40);
    }
}
