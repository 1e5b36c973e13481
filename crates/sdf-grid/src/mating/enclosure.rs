//! Space that two parts enclose together: the inside of a box that a lid closes.

use glam::{DQuat, DVec3};

use crate::mesh::triangle_mesh::TriangleMesh;

/// Cells along each side of the cube around the moving part, and along its diagonal.
const CELLS: usize = 72;
const OF_DIAGONAL: f64 = 24.0;

/// Points on a surface mark the cells it passes; their distance, cells.
const SPACING: f64 = 0.4;

const OUTER: u8 = 1;
const SURFACE: u8 = 2;

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
        let mut marked = [self.fixed, &placed].map(|mesh| self.marked(mesh, corner));
        let mut both: Vec<u8> = marked[0]
            .iter()
            .zip(&marked[1])
            .map(|(a, b)| a | b)
            .collect();
        flood(&mut both);
        for one in &mut marked {
            flood(one);
        }
        let [fixed, moving] = &marked;
        let enclosed = (both.iter().zip(fixed).zip(moving))
            .filter(|((b, f), m)| **b == 0 && **f == OUTER && **m == OUTER)
            .count();
        enclosed as f64 * self.cell.powi(3)
    }

    /// The cells of the cube that a surface passes.
    fn marked(&self, mesh: &TriangleMesh, corner: DVec3) -> Vec<u8> {
        let mut cells = vec![0; CELLS * CELLS * CELLS];
        let wide = CELLS as f64;
        for triangle in mesh.faces() {
            let [a, b, c] = triangle.map(|p| (p - corner) / self.cell);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            if high.min_element() < 0.0 || low.max_element() > wide {
                continue;
            }
            // Rows of points between two sides; only what may lie in the cube of long ones.
            let rows = ((b - a).length().max((c - a).length()) / SPACING)
                .ceil()
                .max(1.0);
            for i in 0..=rows as usize {
                let t = i as f64 / rows;
                let (p, q) = (a.lerp(b, t), a.lerp(c, t));
                let points = (p.distance(q) / SPACING).ceil().max(1.0);
                let Some([from, to]) = within(p, q, wide) else {
                    continue;
                };
                let range = (from * points).floor() as usize..=(to * points).ceil() as usize;
                for j in range {
                    let at = p.lerp(q, j as f64 / points).floor();
                    if at.min_element() >= 0.0 && at.max_element() < wide {
                        cells[index(at.x as usize, at.y as usize, at.z as usize)] = SURFACE;
                    }
                }
            }
        }
        cells
    }
}

/// Which part of the line from `p` to `q` lies in the cube from 0 to `wide`.
fn within(p: DVec3, q: DVec3, wide: f64) -> Option<[f64; 2]> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for k in 0..3 {
        let (start, step) = (p[k], q[k] - p[k]);
        if step == 0.0 {
            if !(0.0..=wide).contains(&start) {
                return None;
            }
            continue;
        }
        let (a, b) = (-start / step, (wide - start) / step);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    (from <= to).then_some([from, to])
}

fn index(x: usize, y: usize, z: usize) -> usize {
    (x * CELLS + y) * CELLS + z
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
        let (x, y, z) = (at / (CELLS * CELLS), at / CELLS % CELLS, at % CELLS);
        for (has, next) in [
            (x > 0, at.wrapping_sub(CELLS * CELLS)),
            (x < last, at + CELLS * CELLS),
            (y > 0, at.wrapping_sub(CELLS)),
            (y < last, at + CELLS),
            (z > 0, at.wrapping_sub(1)),
            (z < last, at + 1),
        ] {
            if has && cells[next] == 0 {
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
        }
    }
}
