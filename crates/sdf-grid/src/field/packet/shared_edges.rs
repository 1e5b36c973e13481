//! Edges that two faces share.

use glam::DVec3;
use rayon::prelude::*;

use crate::surface::face::Face;

/// The edge beyond an edge of a face: the same line between the same corners, the other way round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SharedEdge(u32);

/// Faces, their edges and one flag fit into a word up to this many faces; for larger meshes shared
/// edges are not found.
const MAX_FACES: usize = 1 << 29;

/// Corners that agree to this are one: cuts through neighbouring faces differ by rounding.
const SAME: f64 = 1e-9;

/// Added to a number of a size up to 2^50, leaves its nearest integer in the last bits: cheaper
/// than to round.
const INTEGER: f64 = 1.5 * (1u64 << 52) as f64;

/// The sine of the angle between normals up to which two faces lie in one plane.
const FLAT: f64 = 1e-8;

impl SharedEdge {
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

/// That of an edge which is not there.
const NO_KEY: u64 = 0;

/// No edge.
const NO_HALF: u32 = u32::MAX;

/// More than one edge.
const CROWD: u32 = u32::MAX - 1;

/// The twin of every edge of every face. An edge that more than two faces have mostly has none, one
/// that another face has only in part never: that costs time, not accuracy.
pub(crate) fn find_shared_edges(faces: &[Face]) -> Vec<[SharedEdge; 4]> {
    if faces.len() >= MAX_FACES {
        return vec![[SharedEdge::NONE; 4]; faces.len()];
    }
    let keys: Vec<[u64; 4]> = faces.par_iter().map(keys).collect();
    let partners = partners(&keys);
    let place = |half: u32| (half as usize / 4, half as usize % 4);
    // Corners lie all over memory and looking them up takes longest: each pair once, in the order
    // of the faces, whose neighbours are mostly near in memory, too.
    let first = |i: usize, k: usize| {
        let (j, l) = place(partners[4 * i + k]);
        let is_pair = i < j && j < faces.len();
        let twin = || coplanar(&faces[i], k, &faces[j], l);
        match is_pair.then(twin).flatten() {
            Some(coplanar) => SharedEdge::new(j, l, coplanar),
            None => SharedEdge::NONE,
        }
    };
    let of_face = |i: usize| std::array::from_fn(|k| first(i, k));
    let mut shared_edges: Vec<[SharedEdge; 4]> =
        (0..faces.len()).into_par_iter().map(of_face).collect();
    for i in 0..faces.len() {
        for k in 0..4 {
            if let Some((j, l, coplanar)) = shared_edges[i][k].get()
                && i < j
            {
                shared_edges[j][l] = SharedEdge::new(i, k, coplanar);
            }
        }
    }
    shared_edges
}

/// Edges looked at together first: their table stays in the nearest caches, and next to all find
/// their shared edges there.
const TOGETHER: usize = 4096;

/// Another edge with the same key, of edge `k` of face `i` at `4 i + k`, of which that is the
/// other: [`NO_HALF`] if there is none, [`CROWD`] if several are together.
fn partners(keys: &[[u64; 4]]) -> Vec<u32> {
    let keys = keys.as_flattened();
    let mut partners = vec![NO_HALF; keys.len()];
    let nearby = |(i, own): (usize, &mut [u32])| {
        let first = i * TOGETHER;
        let halves = first..first + own.len();
        pair_up(keys, halves.clone(), own, first);
        let left = |half: &usize| own[half - first] == NO_HALF && keys[*half] != NO_KEY;
        halves.filter(left).collect::<Vec<usize>>()
    };
    let chunks = partners.par_chunks_mut(TOGETHER).enumerate();
    let left: Vec<usize> = chunks.flat_map_iter(nearby).collect();
    pair_up(keys, left.into_iter(), &mut partners, 0);
    partners
}

/// The partners among `halves`, of which `first` is at the start of `partners`.
fn pair_up(
    keys: &[u64],
    halves: impl ExactSizeIterator<Item = usize>,
    partners: &mut [u32],
    first: usize,
) {
    // The first edge of each key, in the first free place from one that its bits give: an eighth to
    // a quarter of the places are taken.
    let mut places = vec![NO_HALF; (2 * halves.len()).next_power_of_two()];
    let last = places.len() - 1;
    for half in halves {
        let key = keys[half];
        if key == NO_KEY {
            continue;
        }
        let mut place = (key >> 16) as usize & last;
        while places[place] != NO_HALF && keys[places[place] as usize] != key {
            place = (place + 1) & last;
        }
        let before = places[place];
        if before == NO_HALF {
            places[place] = half as u32;
            continue;
        }
        let of_before = before as usize - first;
        partners[half - first] = match std::mem::replace(&mut partners[of_before], CROWD) {
            NO_HALF => {
                partners[of_before] = half as u32;
                before
            }
            CROWD => CROWD,
            second => {
                partners[second as usize - first] = CROWD;
                CROWD
            }
        };
    }
}

/// Whether two faces that share the edges `k` and `l` lie in one plane; none if they do not share
/// them.
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

/// For each edge of a face a number that both its directions share and other edges hardly ever.
/// Where rounding of a corner crosses into another cell a twin is missed.
fn keys(face: &Face) -> [u64; 4] {
    let corner = |p: DVec3| {
        let cells = p * (1.0 / SAME) + INTEGER;
        (cells.to_array().iter()).fold(0x9e37_79b9_7f4a_7c15_u64, |h, c| {
            (h.rotate_left(23) ^ c.to_bits()).wrapping_mul(0xff51_afd7_ed55_8ccd)
        })
    };
    let mixed = face.corners.map(corner);
    std::array::from_fn(|k| {
        if k >= face.count {
            return NO_KEY;
        }
        let [a, b] = [mixed[k], mixed[(k + 1) % face.count]];
        a.wrapping_add(b) ^ (a ^ b).rotate_left(32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, PegInHole};
    use crate::surface::bvh::tree::Bvh;

    /// Of few faces, and of more than are looked at together.
    #[test]
    fn closed_meshes_have_a_twin_for_every_edge_and_each_is_its_twins_twin() {
        let (hole, _) = PegInHole::Combined.pair(0.0).unwrap();
        let torus = shapes::torus(1.0, 0.4, 60, 40).unwrap();
        assert!(torus.triangles().len() * 4 > 4 * TOGETHER);
        for mesh in [hole, torus] {
            let faces = Bvh::build(&mesh).faces;
            let shared_edges = find_shared_edges(&faces);
            for (i, face) in faces.iter().enumerate() {
                for k in 0..face.count {
                    let (j, l, coplanar) = shared_edges[i][k].get().expect("closed");
                    assert_eq!(shared_edges[j][l].get(), Some((i, k, coplanar)));
                    let ([a, b], [c, d]) = (ends(face, k), ends(&faces[j], l));
                    assert_eq!([a, b], [d, c]);
                    let apart = faces[j].outline().iter().map(|p| face.height(*p).abs());
                    let flat = apart.fold(0.0, f64::max) < 1e-9;
                    assert_eq!(coplanar, flat && face.normal.dot(faces[j].normal) > 0.0);
                }
            }
        }
    }

    /// An edge of two boxes, four faces: which of them are neighbours is ambiguous.
    #[test]
    fn edges_of_more_than_two_faces_have_no_twins() {
        let mut faces = Bvh::build(&shapes::cuboid(DVec3::ONE).unwrap()).faces;
        let corners = faces.iter().flat_map(Face::outline);
        let width = 2.0 * corners.map(|p| p.x).fold(0.0, f64::max);
        for i in 0..faces.len() {
            let mut face = faces[i];
            face.corners = face.corners.map(|p| p + width * DVec3::X);
            faces.push(face);
        }
        let found = find_shared_edges(&faces);
        let edges = || (0..faces.len()).flat_map(|i| (0..3).map(move |k| (i, k)));
        let mut crowded = 0;
        for (i, k) in edges() {
            let [a, b] = ends(&faces[i], k);
            let same = |[c, d]: [DVec3; 2]| [a, b] == [c, d] || [a, b] == [d, c];
            let holders = edges().filter(|(j, l)| same(ends(&faces[*j], *l)));
            let is_pair = holders.count() == 2;
            assert_eq!(found[i][k] != SharedEdge::NONE, is_pair, "{a} {b}");
            crowded += usize::from(!is_pair);
        }
        // Four sides of the square between the boxes, of four faces each; its diagonals may be two.
        assert!(crowded >= 16, "{crowded}");
    }
}
