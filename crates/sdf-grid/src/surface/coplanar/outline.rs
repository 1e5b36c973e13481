//! Outlines of flat regions, and faces that share them.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::regions::{NONE, Regions, Surface};

/// Quadrangles turn left by this at every corner at least, the sine of the angle.
pub(super) const CONVEX: f64 = 1e-9;

/// Straightening takes a few looks at every corner of a ring, but one by one of a comb's; then it
/// stays.
const MOST_LOOKS: usize = 200;

/// A triangle and one of its edges.
type Side = (u32, usize);

impl Surface<'_> {
    /// The closed chains of edges around a region, the region to their left. They may touch
    /// themselves and each other in corners. None if the mesh is not one of closed fans around its
    /// vertices.
    pub(super) fn loops(&self, regions: &Regions, id: usize) -> Option<Vec<Vec<u32>>> {
        let inside = |t: u32| t != NONE && regions.of[t as usize] == id as u32;
        let beyond = |(t, k): Side| self.neighbours[t as usize][k];
        let mut sides: Vec<Side> = Vec::new();
        for &t in regions.get(id) {
            sides.extend((0..3).map(|k| (t, k)).filter(|s| !inside(beyond(*s))));
        }
        sides.sort_unstable();
        // The next side lies at the end of the fan of the region's triangles around the corner.
        let after = |(t, k): Side| {
            let corner = self.indices[t as usize][(k + 1) % 3];
            let mut side = (t, (k + 1) % 3);
            for _ in 0..regions.get(id).len() {
                let next = beyond(side);
                if !inside(next) {
                    return sides.binary_search(&side).ok();
                }
                let place = self.indices[next as usize]
                    .iter()
                    .position(|v| *v == corner)?;
                side = (next, place);
            }
            None
        };
        let mut done = vec![false; sides.len()];
        let mut loops = Vec::new();
        for first in 0..sides.len() {
            let (mut ring, mut at) = (Vec::new(), first);
            while !done[at] {
                done[at] = true;
                let (t, k) = sides[at];
                ring.push(self.indices[t as usize][k]);
                at = after(sides[at])?;
            }
            // Ends where it began, or at a ring that was done before.
            if at != first {
                return None;
            }
            if !ring.is_empty() {
                loops.push(ring);
            }
        }
        Some(loops)
    }

    /// Whether `b` lies off the straight way from `a` to `c`.
    pub(super) fn is_corner(&self, a: u32, b: u32, c: u32) -> bool {
        self.off_line(a, b, c) > self.flat * self.flat
    }

    /// Squared distance of `b` from the straight way from `a` to `c`.
    fn off_line(&self, a: u32, b: u32, c: u32) -> f64 {
        let at = |v: u32| self.vertices[v as usize];
        let (along, from) = (at(c) - at(a), at(b) - at(a));
        let place = from.dot(along) / along.length_squared();
        // Of a way without a length, the distance from its end.
        let place = if place.is_nan() { 0.0 } else { place };
        from.distance_squared(along * place.clamp(0.0, 1.0))
    }

    /// Rings without the corners on straight sides, but for those in which rings touch: what is
    /// dropped there might lie a little beyond the other ring.
    pub(super) fn all_straightened(&self, rings: &[Vec<u32>]) -> Vec<Vec<u32>> {
        let mut corners = rings.concat();
        corners.sort_unstable();
        let touching = corners.windows(2).filter(|w| w[0] == w[1]).map(|w| w[0]);
        let touching: Vec<u32> = touching.collect();
        let straight = |ring: &Vec<u32>| {
            let straight = self.straightened(ring, &touching);
            straight.unwrap_or_else(|| ring.clone())
        };
        rings.iter().map(straight).collect()
    }

    /// A ring without the corners on straight sides, all within `flat` of what is left (Douglas and
    /// Peucker); none if nothing is left or it takes too long. Those of `keep`, in order, stay.
    pub(super) fn straightened(&self, ring: &[u32], keep: &[u32]) -> Option<Vec<u32>> {
        let at = |k: usize| self.vertices[ring[k] as usize];
        let farthest = |from: DVec3| {
            (0..ring.len()).max_by(|a, b| {
                let [a, b] = [*a, *b].map(|k| from.distance_squared(at(k)));
                a.total_cmp(&b)
            })
        };
        // What is farthest from anything is a corner.
        let first = farthest(at(0))?;
        let opposite = farthest(at(first))?;
        let n = ring.len();
        let vertex = |k: usize| ring[(first + k) % n];
        let mut kept = Vec::with_capacity(n);
        let middle = (opposite + n - first) % n;
        let mut sides = vec![(middle, n), (0, middle)];
        let mut looks = 0;
        while let Some((from, to)) = sides.pop() {
            looks += to - from;
            if looks > MOST_LOOKS * n {
                return None;
            }
            let off = |k: usize| match keep.binary_search(&vertex(k)) {
                Ok(_) => f64::INFINITY,
                Err(_) => self.off_line(vertex(from), vertex(k), vertex(to)),
            };
            let most = (from + 1..to)
                .map(|k| (k, off(k)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            match most {
                Some((k, off)) if off > self.flat * self.flat => sides.extend([(k, to), (from, k)]),
                _ => kept.push(vertex(from)),
            }
        }
        (kept.len() >= 3).then_some(kept)
    }
}

/// Triangles joined in pairs to convex quadrangles across their longest common edges.
pub(super) fn paired(triangles: &[[u32; 3]], at: impl Fn(u32) -> DVec2) -> Vec<Vec<u32>> {
    let mut sides: HashMap<(u32, u32), usize> = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            sides.insert((t[k], t[(k + 1) % 3]), i);
        }
    }
    let mut common: Vec<(f64, u32, u32)> = sides
        .keys()
        .filter(|(a, b)| a < b && sides.contains_key(&(*b, *a)))
        .map(|&(a, b)| (-at(a).distance(at(b)), a, b))
        .collect();
    common.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut used = vec![false; triangles.len()];
    let mut rings = Vec::new();
    for (_, a, b) in common {
        let (i, j) = (sides[&(a, b)], sides[&(b, a)]);
        let apex = |t: [u32; 3]| t.into_iter().find(|v| *v != a && *v != b);
        let (Some(c), Some(d)) = (apex(triangles[i]), apex(triangles[j])) else {
            continue;
        };
        let ring = [a, d, b, c];
        let turn = |k: usize| {
            let [p, q, r] = [0, 1, 2].map(|o| at(ring[(k + o) % 4]));
            (q - p).perp_dot(r - q) > CONVEX * (q - p).length() * (r - q).length()
        };
        if !used[i] && !used[j] && (0..4).all(turn) {
            (used[i], used[j]) = (true, true);
            rings.push(ring.to_vec());
        }
    }
    let single = triangles.iter().zip(&used).filter(|(_, used)| !**used);
    rings.extend(single.map(|(t, _)| t.to_vec()));
    rings
}
