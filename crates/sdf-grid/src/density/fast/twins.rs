//! Which edges of faces are the same line.

use glam::DVec3;
use rayon::prelude::*;

use crate::face::Face;

/// The edge beyond an edge of a face: the same line between the same corners, the other way round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Twin(u32);

/// Faces, their edges and one flag fit into a word up to this many faces; beyond, no twins are kept.
const MAX_FACES: usize = 1 << 29;

/// Corners that agree to this are one: cuts through neighbouring faces differ by rounding.
const SAME: f64 = 1e-9;

/// The sine of the angle between normals up to which two faces lie in one plane.
const FLAT: f64 = 1e-8;

impl Twin {
    pub(crate) const NONE: Self = Self(u32::MAX);

    fn new(face: usize, edge: usize, coplanar: bool) -> Self {
        Self((face as u32) << 3 | (edge as u32) << 1 | u32::from(coplanar))
    }

    /// The other face and its edge, and whether both faces lie in one plane.
    pub(crate) fn get(self) -> Option<(usize, usize, bool)> {
        let edge = (self.0 >> 1 & 3) as usize;
        (self != Self::NONE).then_some(((self.0 >> 3) as usize, edge, self.0 & 1 == 1))
    }
}

/// The twin of every edge of every face. An edge that more than two faces have, or that another face
/// has only in part, has none: that costs time, not accuracy.
pub(crate) fn twins(faces: &[Face]) -> Vec<[Twin; 4]> {
    let mut twins = vec![[Twin::NONE; 4]; faces.len()];
    if faces.len() >= MAX_FACES {
        return twins;
    }
    let mut halves: Vec<(u64, u32)> = (faces.par_iter().enumerate())
        .flat_map_iter(|(i, f)| (0..f.count).map(move |k| (key(ends(f, k)), (4 * i + k) as u32)))
        .collect();
    halves.par_sort_unstable();
    let place = |half: u32| (half as usize / 4, half as usize % 4);
    // Corners lie all over memory: looking them up takes longest.
    let found = halves.par_chunk_by(|a, b| a.0 == b.0).filter_map(|pair| {
        let [(_, a), (_, b)] = *pair else { return None };
        let ((i, k), (j, l)) = (place(a), place(b));
        coplanar(&faces[i], k, &faces[j], l).map(|coplanar| (a, b, coplanar))
    });
    for (a, b, coplanar) in found.collect::<Vec<_>>() {
        let ((i, k), (j, l)) = (place(a), place(b));
        twins[i][k] = Twin::new(j, l, coplanar);
        twins[j][l] = Twin::new(i, k, coplanar);
    }
    twins
}

/// Whether two faces whose edges `k` and `l` are twins lie in one plane; none if they are no twins.
fn coplanar(f: &Face, k: usize, g: &Face, l: usize) -> Option<bool> {
    let ([a, b], [c, d]) = (ends(f, k), ends(g, l));
    let apart = a.distance_squared(d).max(b.distance_squared(c));
    let sine_squared = f.normal.cross(g.normal).length_squared();
    let flat = sine_squared < FLAT * FLAT && f.normal.dot(g.normal) > 0.0;
    (apart < SAME * SAME).then_some(flat)
}

fn ends(face: &Face, k: usize) -> [DVec3; 2] {
    [face.corners[k], face.corners[(k + 1) % face.count]]
}

/// A number that both directions of an edge share and others hardly ever. Where rounding of a corner
/// crosses into another cell a twin is missed.
fn key(ends: [DVec3; 2]) -> u64 {
    let corner = |p: DVec3| {
        let cells = (p / SAME).round();
        (cells.to_array().iter()).fold(0x9e37_79b9_7f4a_7c15_u64, |h, c| {
            (h.rotate_left(23) ^ (*c as i64 as u64)).wrapping_mul(0xff51_afd7_ed55_8ccd)
        })
    };
    let mixed = ends.map(corner);
    mixed[0].wrapping_add(mixed[1]) ^ (mixed[0] ^ mixed[1]).rotate_left(32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Bvh;
    use crate::shapes::PegInHole;

    #[test]
    fn closed_meshes_have_a_twin_for_every_edge_and_each_is_its_twins_twin() {
        let (hole, _) = PegInHole::Combined.pair(0.0).unwrap();
        let faces = Bvh::build(&hole).faces;
        let twins = twins(&faces);
        for (i, face) in faces.iter().enumerate() {
            for k in 0..face.count {
                let (j, l, coplanar) = twins[i][k].get().expect("closed");
                assert_eq!(twins[j][l].get(), Some((i, k, coplanar)));
                let ([a, b], [c, d]) = (ends(face, k), ends(&faces[j], l));
                assert_eq!([a, b], [d, c]);
                let apart = faces[j].outline().iter().map(|p| face.height(*p).abs());
                let flat = apart.fold(0.0, f64::max) < 1e-9;
                assert_eq!(coplanar, flat && face.normal.dot(faces[j].normal) > 0.0);
            }
        }
    }
}
