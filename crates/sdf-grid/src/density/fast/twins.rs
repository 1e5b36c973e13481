//! Which edges of faces are the same line.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

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

/// Lists of edges, by bits of their keys: a power of two. Each is small enough for the nearest caches.
const SHARDS: u64 = 16;

/// That of an edge which is not there.
const NO_KEY: u64 = 0;

/// No edge.
const NO_HALF: u32 = u32::MAX;

/// The twin of every edge of every face. An edge that more than two faces have, or that another face
/// has only in part, has none: that costs time, not accuracy.
pub(crate) fn twins(faces: &[Face]) -> Vec<[Twin; 4]> {
    if faces.len() >= MAX_FACES {
        return vec![[Twin::NONE; 4]; faces.len()];
    }
    let keys = |f: &Face| -> [u64; 4] {
        std::array::from_fn(|k| if k < f.count { key(ends(f, k)) } else { NO_KEY })
    };
    let keys: Vec<[u64; 4]> = faces.par_iter().map(keys).collect();
    let pairs = |shard| pairs(&keys, shard);
    let pairs: Vec<Vec<[u32; 2]>> = (0..SHARDS).into_par_iter().map(pairs).collect();
    let mut partners = vec![[NO_HALF; 4]; faces.len()];
    let place = |half: u32| (half as usize / 4, half as usize % 4);
    for [a, b] in pairs.into_iter().flatten() {
        let ((i, k), (j, l)) = (place(a), place(b));
        partners[i][k] = b;
        partners[j][l] = a;
    }
    // Corners lie all over memory and looking them up takes longest: each pair once, in the order of the faces,
    // whose neighbours are mostly near in memory, too.
    let first = |i: usize, k: usize| {
        let (j, l) = place(partners[i][k]);
        let twin = || coplanar(&faces[i], k, &faces[j], l);
        match (partners[i][k] != NO_HALF && i < j).then(twin).flatten() {
            Some(coplanar) => Twin::new(j, l, coplanar),
            None => Twin::NONE,
        }
    };
    let of_face = |i: usize| std::array::from_fn(|k| first(i, k));
    let mut twins: Vec<[Twin; 4]> = (0..faces.len()).into_par_iter().map(of_face).collect();
    for i in 0..faces.len() {
        for k in 0..4 {
            if let Some((j, l, coplanar)) = twins[i][k].get()
                && i < j
            {
                twins[j][l] = Twin::new(i, k, coplanar);
            }
        }
    }
    twins
}

/// Edges that share a key no other edge has, of the keys of one shard; edge `k` of face `i` is `4 i + k`.
fn pairs(keys: &[[u64; 4]], shard: u64) -> Vec<[u32; 2]> {
    let mut found: HashMap<u64, Holders, BuildHasherDefault<Mixed>> = HashMap::default();
    for (i, keys) in keys.iter().enumerate() {
        for (k, key) in keys.iter().enumerate() {
            if key >> 32 & (SHARDS - 1) == shard && *key != NO_KEY {
                let half = (4 * i + k) as u32;
                let holders = found.entry(*key).or_default();
                if let Some(place) = holders.edges.get_mut(holders.count) {
                    *place = half;
                }
                holders.count += 1;
            }
        }
    }
    let pair = |h: &Holders| (h.count == 2).then_some(h.edges);
    found.values().filter_map(pair).collect()
}

/// The first edges with a key, and how many there are.
#[derive(Default)]
struct Holders {
    edges: [u32; 2],
    count: usize,
}

/// Takes keys for hashes: they are mixed already.
#[derive(Default)]
struct Mixed(u64);

impl Hasher for Mixed {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, _: &[u8]) {
        unreachable!("keys are of 64 bits");
    }

    fn write_u64(&mut self, key: u64) {
        self.0 = key;
    }
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
