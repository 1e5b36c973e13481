//! Vertices that lie within a distance of each other become one.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};

use crate::mesh::aabb::Aabb;

/// Width of a cell in weld distances: most vertices then lie far enough from the cell's faces that
/// one cell is searched for them.
const CELL_WIDTH: f64 = 8.0;

/// The result of welding.
pub(super) struct Weld {
    /// For each vertex, the vertex that replaces it (itself if it was kept).
    pub(super) representative: Vec<u32>,
    /// Number of vertices that were replaced.
    pub(super) merged: usize,
}

/// Welds greedily in lexicographic order of position, so that the outcome does not depend on the
/// order of the vertices. Kept vertices do not move and are more than `distance` apart.
pub(super) fn weld(vertices: &[DVec3], distance: f64) -> Weld {
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    let key = |i: u32| (vertices[i as usize] + 0.0).to_array();
    order.sort_unstable_by(|&a, &b| {
        let (ka, kb) = (key(a), key(b));
        let by_position = (0..3)
            .map(|k| ka[k].total_cmp(&kb[k]))
            .fold(std::cmp::Ordering::Equal, |o, c| o.then(c));
        by_position.then(a.cmp(&b))
    });

    let mut representative: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut merged = 0;
    let mut kept = KeptVertices::new(vertices, distance);
    let mut previous: Option<u32> = None;
    for &i in &order {
        let equal = previous.filter(|&p| key(p) == key(i));
        match equal
            .map(|p| representative[p as usize])
            .or_else(|| kept.near(i))
        {
            Some(r) => {
                representative[i as usize] = r;
                merged += 1;
            }
            None => kept.insert(i),
        }
        previous = Some(i);
    }
    Weld {
        representative,
        merged,
    }
}

/// The kept vertices, by the cubic cell they lie in.
struct KeptVertices<'a> {
    vertices: &'a [DVec3],
    low: DVec3,
    distance: f64,
    cells: HashMap<I64Vec3, Vec<u32>>,
}

impl<'a> KeptVertices<'a> {
    fn new(vertices: &'a [DVec3], distance: f64) -> Self {
        Self {
            vertices,
            low: Aabb::around(vertices.iter().copied()).min,
            distance,
            cells: HashMap::new(),
        }
    }

    fn cell(&self, position: DVec3) -> I64Vec3 {
        ((position - self.low) / (CELL_WIDTH * self.distance))
            .floor()
            .as_i64vec3()
    }

    fn insert(&mut self, vertex: u32) {
        if self.distance > 0.0 {
            let cell = self.cell(self.vertices[vertex as usize]);
            self.cells.entry(cell).or_default().push(vertex);
        }
    }

    /// The nearest kept vertex within the distance; the first kept of equally near ones.
    fn near(&self, vertex: u32) -> Option<u32> {
        if self.distance <= 0.0 {
            return None;
        }
        let position = self.vertices[vertex as usize];
        let low = self.cell(position - self.distance);
        let high = self.cell(position + self.distance);
        let mut best = None;
        let mut best_squared = self.distance * self.distance;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    for &k in self.cells.get(&I64Vec3::new(x, y, z)).into_iter().flatten() {
                        let squared = position.distance_squared(self.vertices[k as usize]);
                        if squared < best_squared || (squared == best_squared && best.is_none()) {
                            (best, best_squared) = (Some(k), squared);
                        }
                    }
                }
            }
        }
        best
    }
}
