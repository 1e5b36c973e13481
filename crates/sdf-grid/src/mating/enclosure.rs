//! Space that two parts enclose together: the inside of a box that a lid closes.

use glam::{DQuat, DVec3};

use crate::mesh::triangle_mesh::TriangleMesh;

/// Cells along each side of the cube around the moving part, and along its diagonal.
const CELLS: usize = 72;
const OF_DIAGONAL: f64 = 24.0;

/// Points on a surface mark the cells it passes; their distance, cells.
const SPACING: f64 = 0.4;

/// Cells that were reached, that a surface passes, beside such a one, and enclosed ones.
const OUTER: u8 = 1;
const SURFACE: u8 = 2;
const NEAR: u8 = 4;
const ENCLOSED: u8 = 8;

/// A question asked at many poses: how much space do two parts enclose that neither encloses alone?
///
/// Both surfaces are marked in a cube of 72 cells along each side, three times as wide as the moving
/// part's diagonal, around that part; what cannot be reached from its boundary is enclosed. Gaps
/// narrower than a cell are closed.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{Enclosure, shapes};
///
/// // Two plates with a gap between them enclose nothing.
/// let plate = shapes::cuboid(DVec3::new(0.02, 0.02, 0.001)).unwrap();
/// let enclosure = Enclosure::new(&plate, &plate);
/// assert_eq!(enclosure.volume(DQuat::IDENTITY, DVec3::new(0.0, 0.0, 0.004)), 0.0);
/// ```
#[derive(Debug)]
pub struct Enclosure<'a> {
    fixed: &'a TriangleMesh,
    moving: &'a TriangleMesh,
    cell: f64,
}

impl<'a> Enclosure<'a> {
    /// Of a fixed and a moving part.
    pub fn new(fixed: &'a TriangleMesh, moving: &'a TriangleMesh) -> Self {
        Self {
            fixed,
            moving,
            cell: moving.bounds().diagonal() / OF_DIAGONAL,
        }
    }

    /// Volume that the parts enclose only together, cubic metres, where `y` of the moving part's frame
    /// lies at `rotation * y + translation` of the fixed part's.
    pub fn volume(&self, rotation: DQuat, translation: DVec3) -> f64 {
        let placed = self.moving.transformed(rotation, translation);
        let half = 0.5 * CELLS as f64 * self.cell;
        let corner = placed.bounds().center() - half;
        let marked = [self.fixed, &placed].map(|mesh| self.marked(mesh, corner));
        let mut both: Vec<u8> = (marked[0].iter().zip(&marked[1]))
            .map(|(a, b)| a | b)
            .collect();
        let [fixed, moving] = marked.map(|mut cells| {
            thicken(&mut cells);
            flood(&mut cells);
            cells
        });
        thicken(&mut both);
        flood(&mut both);
        for at in 0..both.len() {
            if both[at] == 0 && fixed[at] == OUTER && moving[at] == OUTER {
                both[at] = ENCLOSED;
            }
        }
        // With the cells beside a surface that only kept the probe out.
        let beside = |at: &usize| neighbours(*at).any(|next| both[next] == ENCLOSED);
        let enclosed = |at: &usize| both[*at] == ENCLOSED || both[*at] == NEAR && beside(at);
        (0..both.len()).filter(enclosed).count() as f64 * self.cell.powi(3)
    }

    /// The cells of the cube that a surface passes.
    fn marked(&self, mesh: &TriangleMesh, corner: DVec3) -> Vec<u8> {
        let mut cells = vec![0; CELLS * CELLS * CELLS];
        let wide = CELLS as f64;
        for triangle in mesh.faces() {
            let corners = triangle.map(|p| (p - corner) / self.cell);
            // What lies in the cube, as triangles around its first corner.
            let inside = clipped(corners, wide);
            let fan = inside.windows(2).skip(1);
            for (b, c) in fan.map(|pair| (pair[0], pair[1])) {
                mark([inside[0], b, c], &mut cells);
            }
        }
        cells
    }
}

/// Marks the cells in which points of a triangle lie, whose distance is at most the spacing.
fn mark([a, b, c]: [DVec3; 3], cells: &mut [u8]) {
    let most = DVec3::splat((CELLS - 1) as f64);
    let steps = |length: f64| (length / SPACING).ceil().max(1.0);
    let rows = steps((b - a).length().max((c - a).length()));
    for i in 0..=rows as usize {
        let t = i as f64 / rows;
        let (p, q) = (a.lerp(b, t), a.lerp(c, t));
        let points = steps(p.distance(q));
        for j in 0..=points as usize {
            let at = p.lerp(q, j as f64 / points).floor();
            let at = at.clamp(DVec3::ZERO, most);
            cells[index(at.x as usize, at.y as usize, at.z as usize)] = SURFACE;
        }
    }
}

/// The corners of what a triangle has in the cube from 0 to `wide`, in order; none if nothing.
fn clipped(triangle: [DVec3; 3], wide: f64) -> Vec<DVec3> {
    let mut polygon = triangle.to_vec();
    for axis in 0..3 {
        for (sense, bound) in [(1.0, 0.0), (-1.0, -wide)] {
            let height = |p: &DVec3| sense * p[axis] - bound;
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (k, p) in polygon.iter().enumerate() {
                let next = &polygon[(k + 1) % polygon.len()];
                let (here, there) = (height(p), height(next));
                if here >= 0.0 {
                    kept.push(*p);
                }
                if (here < 0.0) != (there < 0.0) {
                    kept.push(p.lerp(*next, here / (here - there)));
                }
            }
            polygon = kept;
        }
    }
    polygon
}

fn index(x: usize, y: usize, z: usize) -> usize {
    (x * CELLS + y) * CELLS + z
}

/// The cells that share a side with a cell.
fn neighbours(at: usize) -> impl Iterator<Item = usize> {
    let last = CELLS - 1;
    let (x, y, z) = (at / (CELLS * CELLS), at / CELLS % CELLS, at % CELLS);
    let sides = [
        (x > 0, at.wrapping_sub(CELLS * CELLS)),
        (x < last, at + CELLS * CELLS),
        (y > 0, at.wrapping_sub(CELLS)),
        (y < last, at + CELLS),
        (z > 0, at.wrapping_sub(1)),
        (z < last, at + 1),
    ];
    sides
        .into_iter()
        .filter_map(|(has, next)| has.then_some(next))
}

/// Marks the cells beside those that a surface passes.
fn thicken(cells: &mut [u8]) {
    for at in 0..cells.len() {
        if cells[at] == SURFACE {
            for next in neighbours(at) {
                if cells[next] == 0 {
                    cells[next] = NEAR;
                }
            }
        }
    }
}

/// Marks the unmarked cells that can be reached from the boundary of the cube.
fn flood(cells: &mut [u8]) {
    let last = CELLS - 1;
    let mut open: Vec<usize> = Vec::new();
    for x in 0..CELLS {
        for y in 0..CELLS {
            for at in [
                index(x, y, 0),
                index(x, y, last),
                index(x, 0, y),
                index(x, last, y),
                index(0, x, y),
                index(last, x, y),
            ] {
                if cells[at] == 0 {
                    cells[at] = OUTER;
                    open.push(at);
                }
            }
        }
    }
    while let Some(at) = open.pop() {
        for next in neighbours(at) {
            if cells[next] == 0 {
                cells[next] = OUTER;
                open.push(next);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    /// Four walls and a floor, 1 mm thick, 30 x 20 x 10 mm outside.
    fn open_box() -> TriangleMesh {
        let wall = |size: [f64; 3], at: [f64; 3]| {
            let [size, at] = [size, at].map(|v| 1e-3 * DVec3::from_array(v));
            cuboid(size).unwrap().transformed(DQuat::IDENTITY, at)
        };
        let walls = [
            wall([30.0, 20.0, 1.0], [0.0, 0.0, 0.5]),
            wall([30.0, 1.0, 10.0], [0.0, 9.5, 5.0]),
            wall([30.0, 1.0, 10.0], [0.0, -9.5, 5.0]),
            wall([1.0, 20.0, 10.0], [14.5, 0.0, 5.0]),
            wall([1.0, 20.0, 10.0], [-14.5, 0.0, 5.0]),
        ];
        TriangleMesh::joined(&walls)
    }

    /// A face far larger than the cube costs no more than what it has in there.
    #[test]
    fn faces_are_cut_to_the_cube() {
        let far = 1e12;
        let face = [
            DVec3::new(-far, -far, 36.5),
            DVec3::new(far, -far, 36.5),
            DVec3::new(0.0, far, 36.5),
        ];
        let inside = clipped(face, CELLS as f64);
        let area = (inside.windows(2).skip(1))
            .map(|w| 0.5 * (w[0] - inside[0]).cross(w[1] - inside[0]).length())
            .sum::<f64>();
        assert!((area - (CELLS * CELLS) as f64).abs() < 1.0, "{area}");
        let mut cells = vec![0; CELLS * CELLS * CELLS];
        for w in inside.windows(2).skip(1) {
            mark([inside[0], w[0], w[1]], &mut cells);
        }
        let marked = |x, y, z| cells[index(x, y, z)] == SURFACE;
        for x in 0..CELLS {
            for y in 0..CELLS {
                assert!(marked(x, y, 36) && !marked(x, y, 35), "{x} {y}");
            }
        }
        assert!(clipped(face.map(|p| p + 100.0 * DVec3::Z), CELLS as f64).is_empty());
    }

    #[test]
    fn a_lid_encloses_the_inside_of_its_box_in_every_frame() {
        let (open, lid) = (open_box(), cuboid(DVec3::new(0.03, 0.02, 0.001)).unwrap());
        for (k, turn) in [DVec3::ZERO, DVec3::new(0.3, -0.8, 0.5)]
            .into_iter()
            .enumerate()
        {
            let turn = DQuat::from_scaled_axis(turn);
            let shift = DVec3::new(0.1, -0.03, 0.02) * k as f64;
            let fixed = open.transformed(turn, shift);
            let enclosure = Enclosure::new(&fixed, &lid);
            let at = |x: f64, z: f64| enclosure.volume(turn, turn * DVec3::new(x, 0.0, z) + shift);
            // 28 x 18 x 9 mm, less the cells that the walls pass; the floor from below closes nothing,
            // and neither does a lid that leaves a gap of some cells.
            let inside = at(0.0, 0.0105);
            assert!((1.5e-6..4.6e-6).contains(&inside), "{inside}");
            assert_eq!(at(0.0, -0.0005), 0.0);
            assert_eq!(at(0.008, 0.0105), 0.0);
            // A lid that is not quite home closes it still: a gap of 2 mm.
            assert!(at(0.0, 0.0125) > 1.5e-6, "{}", at(0.0, 0.0125));
        }
    }
}
