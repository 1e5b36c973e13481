//! The same surface in fewer, better faces: coplanar triangles merged, long faces cut.
//!
//! Every query of a field is an integral over the surface or a distance from it, so any flat pieces
//! will do. Edges between coplanar triangles cost time and cancel: each flat region is outlined
//! afresh, corners on straight sides are dropped, and it is cut into triangles that are joined to
//! quadrangles in pairs. Long faces are then cut across, so that clusters of them are compact.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::face::Face;
use crate::polygon;

/// A triangle belongs to the plane of another if its corners are this near to it, in units of the
/// normalized part: rounding of coordinates, far below any distance that shows in a field.
const FLAT: f64 = 1e-10;

/// A corner this near to the line between its neighbours is dropped.
const STRAIGHT: f64 = 1e-11;

/// Quadrangles turn left by this at every corner at least, the sine of the angle.
const CONVEX: f64 = 1e-9;

/// Faces whose longest edge, squared, exceeds their area this many times are cut across.
const LONG: f64 = 8.0;

/// Cuts one face can undergo, one after the other.
const MAX_CUTS: u32 = 5;

/// Large meshes are cut less, so that cutting makes no more faces than about this many.
const MAX_PIECES: usize = 200_000;

/// Regions of more triangles than this are shared out one by one.
const LARGE: usize = 32;

const NONE: u32 = u32::MAX;

/// Faces in lists one after the other: to put them in one would move each once more.
pub(crate) struct Pieces {
    lists: Vec<Vec<Face>>,
    /// Where each list ends in the order of all.
    ends: Vec<usize>,
}

impl Pieces {
    fn new(lists: Vec<Vec<Face>>) -> Self {
        let mut count = 0;
        let ends = lists.iter().map(|list| {
            count += list.len();
            count
        });
        Self {
            ends: ends.collect(),
            lists,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    pub(crate) fn get(&self, index: usize) -> Option<Face> {
        let list = self.ends.partition_point(|end| *end <= index);
        let start = list.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.lists.get(list)?.get(index - start).copied()
    }
}

/// Faces that cover the triangles of corners `vertices[i]`. Deterministic.
pub(crate) fn merged(indices: &[[u32; 3]], vertices: &[DVec3]) -> Pieces {
    let plane = |t: &[u32; 3]| Plane::of(t.map(|v| vertices[v as usize]));
    let planes = || indices.par_iter().map(plane).collect();
    let (neighbours, planes) = rayon::join(|| neighbours(indices, vertices.len()), planes);
    let surface = Surface {
        indices,
        vertices,
        planes,
        neighbours,
    };
    let regions = surface.regions();
    // Of the small ones, lists of as many as rayon likes, one after the other: their order is the regions'.
    let (large, small): (Vec<usize>, Vec<usize>) =
        (0..regions.count()).partition(|id| regions.get(*id).len() > LARGE);
    let cover = |mut faces: Vec<Face>, id: &usize| {
        surface.cover(&regions, *id, &mut faces);
        faces
    };
    let alone = large.par_iter().with_max_len(1);
    let together = small.par_iter().fold(Vec::new, cover);
    let faces: Vec<Vec<Face>> = alone
        .map(|id| cover(Vec::new(), id))
        .chain(together)
        .collect();
    let count: usize = faces.iter().map(Vec::len).sum();
    let cuts = (MAX_PIECES / count.max(1)).checked_ilog2().unwrap_or(0);
    let pieces = faces
        .into_par_iter()
        .map(|list| cut_across(list, cuts.min(MAX_CUTS)));
    Pieces::new(pieces.collect())
}

/// What the growth of regions asks of a triangle.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    /// Zero if the triangle has no normal.
    area: f64,
}

impl Plane {
    fn of(corners: [DVec3; 3]) -> Self {
        let (normal, area) = Face::normal_and_area(corners).unwrap_or_default();
        Self { normal, area }
    }
}

/// The mesh with what lies beside each triangle.
struct Surface<'a> {
    indices: &'a [[u32; 3]],
    vertices: &'a [DVec3],
    planes: Vec<Plane>,
    /// The triangle beyond edge `k`, or [`NONE`].
    neighbours: Vec<[u32; 3]>,
}

/// Triangles in connected flat regions.
struct Regions {
    /// One region after the other, each beginning with its largest triangle.
    triangles: Vec<u32>,
    /// Where each begins, and the end of the last.
    starts: Vec<usize>,
    /// The region of each triangle, or [`NONE`].
    of: Vec<u32>,
}

impl Regions {
    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    fn get(&self, id: usize) -> &[u32] {
        &self.triangles[self.starts[id]..self.starts[id + 1]]
    }
}

/// The triangle beyond each edge: the one other triangle that has it, the other way round.
fn neighbours(indices: &[[u32; 3]], vertices: usize) -> Vec<[u32; 3]> {
    let edge = |half: u32| {
        let (t, k) = (indices[half as usize / 3], half as usize % 3);
        (t[k], t[(k + 1) % 3])
    };
    let lower = |half: u32| edge(half).0.min(edge(half).1) as usize;
    let halves = 0..3 * indices.len() as u32;
    // Edges by their lower vertex: counted, then put in their places.
    let mut places = vec![0u32; vertices + 1];
    for half in halves.clone() {
        places[lower(half) + 1] += 1;
    }
    for v in 0..vertices {
        places[v + 1] += places[v];
    }
    let mut sorted = vec![(0u32, 0u32); 3 * indices.len()];
    for half in halves {
        let place = &mut places[lower(half)];
        sorted[*place as usize] = (edge(half).0.max(edge(half).1), half);
        *place += 1;
    }
    let mut beyond = vec![[NONE; 3]; indices.len()];
    let mut first = 0;
    // Each place has moved on to the end of its vertex's edges.
    for end in &places[..vertices] {
        let around = &mut sorted[first..*end as usize];
        first = *end as usize;
        around.sort_unstable();
        for pair in around.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, x), (_, y)] = *pair
                && edge(x).0 != edge(y).0
            {
                beyond[x as usize / 3][x as usize % 3] = y / 3;
                beyond[y as usize / 3][y as usize % 3] = x / 3;
            }
        }
    }
    beyond
}

impl Surface<'_> {
    /// Connected flat regions, grown from the largest triangle on.
    fn regions(&self) -> Regions {
        // Largest first: numbers that are not negative are ordered as their bits are.
        let seed = |(i, plane): (usize, &Plane)| {
            let size = u64::from((plane.area as f32).to_bits());
            (plane.area > 0.0).then_some((u64::from(u32::MAX) - size) << 32 | i as u64)
        };
        let mut seeds: Vec<u64> = (self.planes.par_iter().enumerate())
            .filter_map(seed)
            .collect();
        seeds.par_sort_unstable();
        let mut regions = Regions {
            triangles: Vec::with_capacity(seeds.len()),
            starts: vec![0],
            of: vec![NONE; self.indices.len()],
        };
        for seed in seeds {
            let seed = seed as u32;
            if regions.of[seed as usize] != NONE {
                continue;
            }
            let id = regions.count() as u32;
            let mut next = regions.triangles.len();
            regions.of[seed as usize] = id;
            regions.triangles.push(seed);
            while let Some(&t) = regions.triangles.get(next) {
                next += 1;
                for n in self.neighbours[t as usize] {
                    if n != NONE && regions.of[n as usize] == NONE && self.lies_in(n, seed) {
                        regions.of[n as usize] = id;
                        regions.triangles.push(n);
                    }
                }
            }
            regions.starts.push(next);
        }
        regions
    }

    /// Whether a triangle lies in the plane of another.
    fn lies_in(&self, triangle: u32, other: u32) -> bool {
        let (t, plane) = (
            &self.planes[triangle as usize],
            &self.planes[other as usize],
        );
        let origin = self.corners(other)[0];
        let height = |c: DVec3| (c - origin).dot(plane.normal);
        t.area > 0.0
            && t.normal.dot(plane.normal) > 0.9
            && self
                .corners(triangle)
                .iter()
                .all(|c| height(*c).abs() <= FLAT)
    }

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.indices[triangle as usize].map(|v| self.vertices[v as usize])
    }

    fn face(&self, triangle: u32) -> Option<Face> {
        Face::triangle(self.corners(triangle), triangle)
    }

    fn area(&self, region: &[u32]) -> f64 {
        region.iter().map(|t| self.planes[*t as usize].area).sum()
    }

    /// Appends faces that cover a region: cut anew, or its triangles where that fails.
    fn cover(&self, regions: &Regions, id: usize, faces: &mut Vec<Face>) {
        let region = regions.get(id);
        let area = self.area(region);
        let covers = |faces: &[Face]| {
            let covered: f64 = faces.iter().map(|f| f.area).sum();
            (covered - area).abs() <= 1e-9 * area
        };
        // Most regions of curved parts: without a list.
        if let [a, b] = *region
            && let Some(face) = self.pair(a, b)
            && covers(std::slice::from_ref(&face))
        {
            faces.push(face);
            return;
        }
        if region.len() > 2
            && let Some(anew) = self.outlined(regions, id)
            && covers(&anew)
        {
            faces.extend(anew);
            return;
        }
        faces.extend(region.iter().filter_map(|t| self.face(*t)));
    }

    /// Two triangles of one plane as one face; none if that is not convex.
    fn pair(&self, a: u32, b: u32) -> Option<Face> {
        let k = self.neighbours[a as usize].iter().position(|n| *n == b)?;
        let l = self.neighbours[b as usize].iter().position(|n| *n == a)?;
        let (of_a, of_b) = (self.indices[a as usize], self.indices[b as usize]);
        let ring = [
            of_a[(k + 1) % 3],
            of_a[(k + 2) % 3],
            of_a[k],
            of_b[(l + 2) % 3],
        ];
        let corner = |k: usize| self.is_corner(ring[k], ring[(k + 1) % 4], ring[(k + 2) % 4]);
        if !(0..4).all(corner) {
            let kept: [u32; 3] = self.straightened(&ring)?.try_into().ok()?;
            return Face::triangle(kept.map(|v| self.vertices[v as usize]), a);
        }
        let at = |k: usize| self.vertices[ring[k] as usize];
        let normal = self.planes[a as usize].normal;
        let turns = |k: usize| {
            let [p, q, r] = [k, (k + 1) % 4, (k + 2) % 4].map(at);
            let (along, on) = (q - p, r - q);
            along.cross(on).dot(normal) > CONVEX * along.length() * on.length()
        };
        let corners = [0, 1, 2, 3].map(at);
        (0..4)
            .all(turns)
            .then(|| Face::quadrangle(corners, a))
            .flatten()
    }

    /// A region of several triangles cut anew; none if its outline touches itself.
    fn outlined(&self, regions: &Regions, id: usize) -> Option<Vec<Face>> {
        let seed = self.face(regions.get(id)[0])?;
        let (across, up) = (seed.along[0], seed.normal.cross(seed.along[0]));
        let flat = |v: u32| {
            let p = self.vertices[v as usize] - seed.corners[0];
            DVec2::new(p.dot(across), p.dot(up))
        };
        let loops = self.loops(regions, id)?;
        let rings: Vec<Vec<DVec2>> = loops
            .iter()
            .map(|ring| ring.iter().map(|v| flat(*v)).collect())
            .collect();
        let (flat, cuts) = polygon::triangulate_compactly(&rings)?;
        let mut corners: Vec<DVec3> = loops
            .iter()
            .flatten()
            .map(|v| self.vertices[*v as usize])
            .collect();
        let added = &flat[corners.len()..];
        corners.extend(
            added
                .iter()
                .map(|p| seed.corners[0] + across * p.x + up * p.y),
        );
        let face = |ring: &Vec<u32>| {
            let at = |k: usize| corners[ring[k] as usize];
            match ring.len() {
                3 => Face::triangle([0, 1, 2].map(at), seed.source),
                _ => Face::quadrangle([0, 1, 2, 3].map(at), seed.source),
            }
        };
        let rings = paired(&cuts, |i| flat[i as usize]);
        Some(rings.iter().filter_map(face).collect())
    }

    /// The closed chains of edges around a region, without corners on straight sides; none if one
    /// vertex is passed twice.
    fn loops(&self, regions: &Regions, id: usize) -> Option<Vec<Vec<u32>>> {
        let mut sides = Vec::new();
        for &t in regions.get(id) {
            let corners = self.indices[t as usize];
            for (k, beyond) in self.neighbours[t as usize].into_iter().enumerate() {
                if beyond == NONE || regions.of[beyond as usize] != id as u32 {
                    sides.push((corners[k], corners[(k + 1) % 3]));
                }
            }
        }
        sides.sort_unstable();
        if sides.windows(2).any(|w| w[0].0 == w[1].0) {
            return None;
        }
        let mut done = vec![false; sides.len()];
        let mut loops = Vec::new();
        for first in 0..sides.len() {
            let (mut ring, mut at) = (Vec::new(), first);
            while !done[at] {
                done[at] = true;
                ring.push(sides[at].0);
                at = sides.binary_search_by_key(&sides[at].1, |s| s.0).ok()?;
            }
            // Ends where it began, or at a ring that was done before.
            if at != first {
                return None;
            }
            if !ring.is_empty() {
                loops.push(self.straightened(&ring)?);
            }
        }
        Some(loops)
    }

    /// Whether the way from `a` to `c` bends at `b`.
    fn is_corner(&self, a: u32, b: u32, c: u32) -> bool {
        let at = |v: u32| self.vertices[v as usize];
        let (along, from) = (at(c) - at(a), at(b) - at(a));
        let length = along.length();
        from.dot(along) <= 0.0
            || from.dot(along) >= length * length
            || from.cross(along).length() > STRAIGHT * length
    }

    /// A ring without the corners on straight sides; none if nothing is left.
    fn straightened(&self, ring: &[u32]) -> Option<Vec<u32>> {
        let n = ring.len();
        let first =
            (0..n).find(|&i| self.is_corner(ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]))?;
        let mut kept = vec![ring[first]];
        for i in 1..n {
            let (b, c) = (ring[(first + i) % n], ring[(first + i + 1) % n]);
            if self.is_corner(*kept.last()?, b, c) {
                kept.push(b);
            }
        }
        (kept.len() >= 3).then_some(kept)
    }
}

/// Triangles joined in pairs to convex quadrangles across their longest common edges.
fn paired(triangles: &[[u32; 3]], at: impl Fn(u32) -> DVec2) -> Vec<Vec<u32>> {
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

/// Faces in pieces that are not long, after `cuts` cuts one after the other at most. Cuts go through the
/// middles of long edges, so that those of neighbours meet.
fn cut_across(faces: Vec<Face>, cuts: u32) -> Vec<Face> {
    if cuts == 0 || !faces.iter().any(|f| long_edge(f).is_some()) {
        return faces;
    }
    let (mut done, mut waiting) = (Vec::with_capacity(2 * faces.len()), Vec::new());
    for face in faces {
        waiting.push((face, cuts));
        while let Some((f, cuts)) = waiting.pop() {
            let pieces = long_edge(&f).filter(|_| cuts > 0).map(|k| halves(&f, k));
            match pieces {
                Some([Some(a), Some(b)]) if (a.area + b.area - f.area).abs() <= 1e-9 * f.area => {
                    waiting.extend([(a, cuts - 1), (b, cuts - 1)]);
                }
                _ => done.push(f),
            }
        }
    }
    done
}

/// The longest edge of a face that is drawn out along it.
fn long_edge(f: &Face) -> Option<usize> {
    let longest = (0..f.count).fold(0, |a, k| if f.length[k] > f.length[a] { k } else { a });
    (f.length[longest] * f.length[longest] > LONG * f.area).then_some(longest)
}

/// A face cut from the middle of its longest edge to that of the opposite edge, of a triangle to that of
/// the next longest edge.
fn halves(f: &Face, longest: usize) -> [Option<Face>; 2] {
    let corner = |k: usize| f.corners[(longest + k) % f.count];
    let middle = |k: usize| 0.5 * (corner(k) + corner(k + 1));
    let (from, [a, b, c]) = (middle(0), [0, 1, 2].map(corner));
    let triangle = |corners| Face::triangle(corners, f.source);
    let quadrangle = |corners| Face::quadrangle(corners, f.source);
    if f.count == 4 {
        let (to, d) = (middle(2), corner(3));
        return [quadrangle([a, from, to, d]), quadrangle([from, b, c, to])];
    }
    if f.length[(longest + 1) % 3] > f.length[(longest + 2) % 3] {
        let to = middle(1);
        [triangle([from, b, to]), quadrangle([a, from, to, c])]
    } else {
        let to = middle(2);
        [triangle([a, from, to]), quadrangle([from, b, c, to])]
    }
}
