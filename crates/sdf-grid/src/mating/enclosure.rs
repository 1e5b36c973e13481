//! Space that two parts enclose together: the inside of a box that a lid closes.

use glam::{DQuat, DVec3};

use crate::mesh::triangle_mesh::TriangleMesh;

/// Cells along each side of the cube around the moving part, and along its diagonal.
const CELLS: usize = 72;
const OF_DIAGONAL: f64 = 24.0;

/// Points on a surface mark the cells it passes; their distance, cells.
const SPACING: f64 = 0.4;

/// A set of cells of the cube: a row of bits along z for every x and y.
#[derive(Debug, Clone, PartialEq)]
struct Cells(Vec<u128>);

/// All cells of a row.
const ROW: u128 = (1 << CELLS) - 1;

/// A question asked at many poses: how much space do two parts enclose that neither encloses alone?
///
/// Both surfaces are marked in a cube of 72 cells along each side, three times as wide as the moving
/// part's diagonal, around that part; what cannot be reached from its boundary is enclosed. A
/// probe three cells wide must pass: gaps of less than two cells are closed.
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
        let [fixed, moving] = [self.fixed, &placed].map(|mesh| self.marked(mesh, corner));
        let both = fixed.or(&moving);
        let near = both.thickened();
        let reached = near.complement().reached();
        let [fixed, moving] = [fixed, moving].map(|own| own.thickened().complement().reached());
        let enclosed = near.or(&reached).complement().and(&fixed).and(&moving);
        // With the cells beside a surface that only kept the probe out.
        let beside = enclosed.thickened().and(&near).and(&both.complement());
        enclosed.or(&beside).count() as f64 * self.cell.powi(3)
    }

    /// The cells of the cube that a surface passes.
    fn marked(&self, mesh: &TriangleMesh, corner: DVec3) -> Cells {
        let mut cells = Cells::none();
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
fn mark([a, b, c]: [DVec3; 3], cells: &mut Cells) {
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
            cells.0[at.x as usize * CELLS + at.y as usize] |= 1 << at.z as u32;
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

impl Cells {
    fn none() -> Self {
        Self(vec![0; CELLS * CELLS])
    }

    fn or(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a | b).collect())
    }

    fn and(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a & b).collect())
    }

    fn complement(&self) -> Self {
        Self(self.0.iter().map(|row| !row & ROW).collect())
    }

    fn count(&self) -> u32 {
        self.0.iter().map(|row| row.count_ones()).sum()
    }

    /// The rows beside a row, together.
    fn beside(&self, x: usize, y: usize) -> u128 {
        let row = |there: bool, x: usize, y: usize| if there { self.0[x * CELLS + y] } else { 0 };
        row(x > 0, x.wrapping_sub(1), y)
            | row(x + 1 < CELLS, x + 1, y)
            | row(y > 0, x, y.wrapping_sub(1))
            | row(y + 1 < CELLS, x, y + 1)
    }

    /// With the cells that share a side with one of them.
    fn thickened(&self) -> Self {
        let row = |at: usize| {
            let own = self.0[at];
            (own | own << 1 | own >> 1 | self.beside(at / CELLS, at % CELLS)) & ROW
        };
        Self((0..self.0.len()).map(row).collect())
    }

    /// Those of them that can be reached from the boundary of the cube.
    fn reached(&self) -> Self {
        let last = CELLS - 1;
        let mut found = self.clone();
        for (at, row) in found.0.iter_mut().enumerate() {
            let [x, y] = [at / CELLS, at % CELLS];
            if ![x, y].iter().any(|k| *k == 0 || *k == last) {
                *row &= 1 | 1 << last;
            }
        }
        // Forth and back, until a sweep finds no more.
        loop {
            let before = found.clone();
            (0..self.0.len()).for_each(|at| self.reach(&mut found, at));
            (0..self.0.len())
                .rev()
                .for_each(|at| self.reach(&mut found, at));
            if found == before {
                return found;
            }
        }
    }

    /// Adds the cells of a row that can be reached from what has been reached in it and beside it.
    fn reach(&self, found: &mut Self, at: usize) {
        let (own, open) = (found.0[at], self.0[at]);
        let mut row = own | open & found.beside(at / CELLS, at % CELLS);
        if row == own && own != 0 && (own << 1 | own >> 1) & open & !own == 0 {
            return;
        }
        // By twice as many cells each time, as far as all in between are open.
        let [mut up, mut down] = [open; 2];
        let mut step = 1;
        while step < CELLS {
            row |= up & row << step | down & row >> step;
            up &= up << step;
            down &= down >> step;
            step *= 2;
        }
        found.0[at] = row;
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
        let mut cells = Cells::none();
        for w in inside.windows(2).skip(1) {
            mark([inside[0], w[0], w[1]], &mut cells);
        }
        let marked = |x: usize, y: usize, z: usize| cells.0[x * CELLS + y] >> z & 1 == 1;
        for x in 0..CELLS {
            for y in 0..CELLS {
                assert!(marked(x, y, 36) && !marked(x, y, 35), "{x} {y}");
            }
        }
        assert!(clipped(face.map(|p| p + 100.0 * DVec3::Z), CELLS as f64).is_empty());
    }

    /// Against cell by cell, in mazes that are more and less open.
    #[test]
    fn what_is_reached_in_rows_is_what_is_reached_cell_by_cell() {
        use rand::{Rng, SeedableRng, rngs::SmallRng};
        let mut random = SmallRng::seed_from_u64(3);
        let open = |cells: &Cells, at: [usize; 3]| {
            at.iter().all(|k| *k < CELLS) && cells.0[at[0] * CELLS + at[1]] >> at[2] & 1 == 1
        };
        for share in [0.25, 0.33, 0.4, 0.7] {
            let mut row =
                || (0..CELLS).fold(0, |r, _| r << 1 | u128::from(random.random_bool(share)));
            let maze = Cells((0..CELLS * CELLS).map(|_| row()).collect());
            let mut slow = Cells::none();
            let all = (0..CELLS.pow(3)).map(|k| [k / CELLS / CELLS, k / CELLS % CELLS, k % CELLS]);
            let edge = |at: &[usize; 3]| at.iter().any(|k| *k == 0 || *k == CELLS - 1);
            let mut stack: Vec<[usize; 3]> = all.filter(edge).collect();
            while let Some(at) = stack.pop() {
                if open(&maze, at) && !open(&slow, at) {
                    slow.0[at[0] * CELLS + at[1]] |= 1 << at[2];
                    for axis in 0..3 {
                        for step in [1, usize::MAX] {
                            let mut next = at;
                            next[axis] = next[axis].wrapping_add(step);
                            stack.push(next);
                        }
                    }
                }
            }
            let found = maze.reached();
            assert!(found == slow, "{share}");
            assert!(slow.count() > 0 && (slow.count() < maze.count() || share > 0.6));
        }
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
