//! Solids made of cubes, and a puzzle made of such solids.

use std::collections::HashSet;

use glam::{DVec3, I64Vec3};

use super::solids::{finish, out_of_range, positive};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Cells lie within this distance of the origin along every axis.
const FARTHEST: i32 = 64;

/// Cubes with edges `edge`, the cell `[i, j, k]` between `edge * [i, j, k]` and `edge * [i + 1, j + 1,
/// k + 1]`, as one solid whose walls are set back by half of `clearance` (both metres): solids of cells
/// that exclude each other lie `clearance` apart.
///
/// # Errors
/// If there is no cell, one is farther than 64 from the origin, the edge is not positive, or the
/// clearance is not 0.002 .. 0.5 edges.
pub fn blocks(cells: &[[i32; 3]], edge: f64, clearance: f64) -> Result<TriangleMesh, MeshError> {
    positive("blocks", "edge", edge)?;
    if !(0.002..=0.5).contains(&(clearance / edge)) {
        let expected = "0.002 .. 0.5 edges";
        return Err(out_of_range("blocks", "clearance", expected, clearance));
    }
    let far = |x: &&i32| !(-FARTHEST..FARTHEST).contains(*x);
    if let Some(found) = cells.iter().flatten().find(far) {
        let found = f64::from(*found);
        return Err(out_of_range("blocks", "cell", "-64 .. 63", found));
    }
    let fine = set_back(cells);
    let corner = |plane: I64Vec3| {
        // Cell 2 i + 1 is the inside of a cube, cell 2 i the gap before it.
        let along = |p: i64| {
            let side = if p.rem_euclid(2) == 1 { 0.5 } else { -0.5 };
            p.div_euclid(2) as f64 * edge + side * clearance
        };
        DVec3::from_array(plane.to_array().map(along))
    };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let mut sorted: Vec<I64Vec3> = fine.iter().copied().collect();
    sorted.sort_unstable_by_key(|c| c.to_array());
    for cell in sorted {
        for axis in 0..3 {
            for side in [0, 1] {
                let out = I64Vec3::AXES[axis] * (2 * side - 1);
                if fine.contains(&(cell + out)) {
                    continue;
                }
                let [u, v] = [1, 2].map(|k| I64Vec3::AXES[(axis + k) % 3]);
                let low = cell + I64Vec3::AXES[axis] * side;
                let first = vertices.len() as u32;
                vertices.extend([low, low + u, low + u + v, low + v].map(corner));
                // Counter-clockwise seen from outside.
                let quad = match side {
                    1 => [[0, 1, 2], [0, 2, 3]],
                    _ => [[0, 2, 1], [0, 3, 2]],
                };
                triangles.extend(quad.map(|t| t.map(|i: u32| first + i)));
            }
        }
    }
    finish("blocks", vertices, triangles)
}

/// The insides of cubes and the gaps between two of them, as cells of a lattice twice as fine: those
/// all of whose neighbours across gaps are cubes of the solid.
fn set_back(cells: &[[i32; 3]]) -> HashSet<I64Vec3> {
    let wide = |c: &[i32; 3]| I64Vec3::from_array(c.map(i64::from));
    let filled: HashSet<I64Vec3> = cells.iter().map(wide).collect();
    let belongs = |fine: I64Vec3| {
        let cubes = |f: i64| match f.rem_euclid(2) {
            1 => vec![f.div_euclid(2)],
            _ => vec![f.div_euclid(2) - 1, f.div_euclid(2)],
        };
        let [x, y, z] = fine.to_array().map(cubes);
        x.iter().all(|x| {
            y.iter()
                .all(|y| z.iter().all(|z| filled.contains(&I64Vec3::new(*x, *y, *z))))
        })
    };
    let about = |cube: &I64Vec3| {
        let low = *cube * 2;
        let offsets = (0..27).map(|i| I64Vec3::new(i / 9, i / 3 % 3, i % 3));
        offsets.map(move |o| low + o).collect::<Vec<_>>()
    };
    filled
        .iter()
        .flat_map(about)
        .filter(|fine| belongs(*fine))
        .collect()
}

/// Half the length of a stick of the burr, cells.
const HALF: i32 = 3;

/// Which stick has the cells that several could have, but for those of the key.
const OWNERS: [([i32; 3], usize); 20] = [
    ([-1, -2, 0], 0),
    ([-1, -1, 0], 0),
    ([0, -2, 0], 0),
    ([0, -1, 0], 0),
    ([-1, -2, -1], 2),
    ([-1, -1, -2], 2),
    ([-1, 0, -2], 2),
    ([0, -2, -1], 2),
    ([0, -1, -2], 2),
    ([-1, -1, 1], 3),
    ([-1, 0, 1], 3),
    ([0, 0, 1], 3),
    ([-2, -1, -1], 4),
    ([-2, -1, 0], 4),
    ([-1, -1, -1], 4),
    ([0, -1, -1], 5),
    ([0, -1, 1], 5),
    ([0, 0, -2], 5),
    ([1, -1, -1], 5),
    ([1, -1, 0], 5),
];

/// A burr of six sticks, two along each of x, y and z, where they are assembled; each is 6 `edge` long
/// and 2 `edge` wide, with `clearance` between them (metres). The second one, along x, is a whole bar:
/// it is the only one that can be moved, and its only way is along x. Without it the others come
/// apart, one or several at a time.
///
/// # Errors
/// If the edge is not positive, or the clearance is not 0.002 .. 0.5 edges.
pub fn burr(edge: f64, clearance: f64) -> Result<[TriangleMesh; 6], MeshError> {
    const KEY: usize = 1;
    let sticks: [HashSet<[i32; 3]>; 6] = std::array::from_fn(stick);
    let has = |i: usize, cell: &[i32; 3]| {
        let shared = (0..6).any(|j| j != i && sticks[j].contains(cell));
        let owner = OWNERS.iter().find(|(c, _)| c == cell);
        i == KEY || !shared || owner.is_some_and(|(_, owner)| *owner == i)
    };
    let piece = |i: usize| {
        let mut cells: Vec<[i32; 3]> = sticks[i].iter().copied().collect();
        cells.retain(|c| has(i, c));
        blocks(&cells, edge, clearance)
    };
    let [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map(piece);
    Ok([a?, b?, c?, d?, e?, f?])
}

/// The cells of the bar that a stick is cut from.
fn stick(index: usize) -> HashSet<[i32; 3]> {
    let (along, across) = (index / 2, 2 * (index as i32 % 2) - 2);
    let mut cells = HashSet::new();
    for l in -HALF..HALF {
        for u in across..across + 2 {
            for v in -1..1 {
                let mut cell = [0; 3];
                cell[along] = l;
                cell[(along + 1) % 3] = u;
                cell[(along + 2) % 3] = v;
                cells.insert(cell);
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::bvh::tree::Bvh;

    #[test]
    fn walls_are_set_back_by_half_the_clearance() {
        let (edge, clearance) = (0.005, 2e-4);
        // An L of four cells, so that one corner points inwards.
        let cells = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]];
        let solid = blocks(&cells, edge, clearance).unwrap();
        let bounds = solid.bounds();
        assert!((bounds.min - DVec3::splat(0.5 * clearance)).length() < 1e-12);
        let size = DVec3::new(3.0, 2.0, 1.0) * edge - clearance;
        assert!((bounds.size() - size).length() < 1e-12);
        let [a, b] = [3.0 * edge - clearance, edge - clearance];
        let volume = (a * b + edge * b) * b;
        assert!((solid.volume() / volume - 1.0).abs() < 1e-9);
        let surface = Bvh::build(&solid);
        let inner = DVec3::new(edge - 0.5 * clearance, edge - 0.5 * clearance, 0.5 * edge);
        assert!(surface.signed_distance(inner).abs() < 1e-9);
        assert!(blocks(&[], edge, clearance).is_err());
        assert!(blocks(&cells, edge, edge).is_err() && blocks(&[[99, 0, 0]], edge, 1e-4).is_err());
    }

    #[test]
    fn the_sticks_of_a_burr_fill_it_and_keep_apart() {
        let (edge, clearance) = (0.004, 1e-4);
        let sticks = burr(edge, clearance).unwrap();
        let solids = sticks.each_ref().map(Bvh::build);
        for (i, stick) in sticks.iter().enumerate() {
            for (j, other) in solids.iter().enumerate().filter(|(j, _)| *j != i) {
                for p in stick.vertices() {
                    let apart = other.signed_distance(*p);
                    assert!(apart > 0.999 * clearance, "{i} {j}: {apart}");
                }
            }
        }
        let volumes: f64 = sticks.iter().map(TriangleMesh::volume).sum();
        // 104 cells, less the gaps.
        let whole = 104.0 * edge.powi(3);
        assert!(
            (0.9..1.0).contains(&(volumes / whole)),
            "{}",
            volumes / whole
        );
    }
}
