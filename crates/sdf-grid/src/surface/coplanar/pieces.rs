//! Planar regions cut into few convex faces.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::outline::UNFOLDED;
use super::regions::{LARGE, Regions, Surface};
use crate::mesh::polygon;
use crate::mesh::topology::{HalfEdge, Topology};
use crate::surface::face::Piece;

/// Tolerance of coplanarity that allows for rounding only, in units of the normalized part, whose
/// longest side is 1 to 2: far below any distance that shows in a field.
pub(crate) const EXACT: f64 = 1e-10;

/// Faces whose longest edge, squared, exceeds their area this many times are cut across.
const LONG: f64 = 8.0;

/// Quadrangles turn left by this at every corner at least, the sine of the angle.
const CONVEX: f64 = 1e-9;

/// Cuts one face can undergo, one after the other.
const MAX_CUTS: u32 = 5;

/// Large meshes are cut less, so that cutting makes no more faces than about this many.
const MAX_PIECES: usize = 100_000;

/// The faces of a surface, in consecutive lists: one list would cost another copy of each face.
pub(crate) struct Pieces {
    lists: Vec<Vec<Piece>>,
    /// The index after the last face of each list.
    ends: Vec<usize>,
    /// Whether the triangles form a closed surface of one orientation.
    pub(crate) closed: bool,
}

impl Pieces {
    fn new(lists: Vec<Vec<Piece>>, closed: bool) -> Self {
        let mut count = 0;
        let ends = lists.iter().map(|list| {
            count += list.len();
            count
        });
        Self {
            ends: ends.collect(),
            lists,
            closed,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    pub(crate) fn get(&self, index: usize) -> Option<Piece> {
        let list = self.ends.partition_point(|end| *end <= index);
        let start = list.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.lists.get(list)?.get(index - start).copied()
    }
}

/// Covers the triangles with fewer faces: triangles whose corners lie within `flat` (at least
/// [`EXACT`], unit of `vertices`) of a common plane are merged and cut anew. Deterministic.
pub(crate) fn merge_coplanar(indices: &[[u32; 3]], vertices: &[DVec3], flat: f64) -> Pieces {
    let surface = Surface::new(indices, vertices, flat);
    let regions = surface.regions();
    let cover = |mut faces: Vec<Piece>, id: usize| {
        surface.cover(&regions, id, &mut faces);
        faces
    };
    let large: Vec<usize> = (0..regions.count())
        .filter(|id| regions.get(*id).len() > LARGE)
        .collect();
    let alone = large.into_par_iter().with_max_len(1);
    // Small regions in the order of the mesh, in which neighbours are mostly close in memory.
    let together = (0..indices.len()).into_par_iter().with_min_len(1024);
    let together = together.filter_map(|t| regions.small_from(t as u32));
    let faces: Vec<Vec<Piece>> = alone
        .map(|id| cover(Vec::new(), id))
        .chain(together.fold(Vec::new, cover))
        .collect();
    let count: usize = faces.iter().map(Vec::len).sum();
    let cuts = (MAX_PIECES / count.max(1)).checked_ilog2().unwrap_or(0);
    let pieces = faces
        .into_par_iter()
        .map(|list| cut_across(list, cuts.min(MAX_CUTS), flat));
    Pieces::new(pieces.collect(), surface.topology.is_closed())
}

impl Surface<'_> {
    fn face(&self, triangle: u32) -> Option<Piece> {
        Piece::triangle(self.corners(triangle), triangle)
    }

    /// Appends faces that cover a region: the region triangulated anew, or its own triangles where
    /// that fails.
    fn cover(&self, regions: &Regions, id: usize, faces: &mut Vec<Piece>) {
        let region = regions.get(id);
        let normal = self.plane(regions, id).normal;
        let facets = || region.iter().map(|t| &self.facets[*t as usize]);
        let area: f64 = facets().map(|f| f.area * f.normal.dot(normal)).sum();
        let unfolded = area > UNFOLDED * facets().map(|f| f.area).sum::<f64>();
        let covers = |faces: &[Piece]| {
            let covered: f64 = faces.iter().map(|f| f.area).sum();
            let off = (covered - area).abs();
            let slack = || faces.iter().map(|f| slack(f, self.flat)).sum();
            unfolded && (off <= 1e-9 * covered || off <= slack())
        };
        // Pairs of triangles are most regions of curved parts: no list is allocated for them.
        if let [a, b] = *region
            && let Some(face) = self.join_two(a, b, normal)
            && covers(std::slice::from_ref(&face))
        {
            faces.push(face);
            return;
        }
        if region.len() > 2
            && let Some(anew) = self.triangulate_region(regions, id)
            && covers(&anew)
        {
            faces.extend(anew);
            return;
        }
        faces.extend(region.iter().filter_map(|t| self.face(*t)));
    }

    /// The side of a triangle beyond which another lies.
    fn side_towards(&self, triangle: u32, other: u32) -> Option<usize> {
        let beyond = self.topology.neighbours(triangle as usize);
        beyond.iter().position(|n| *n == Some(other))
    }

    /// Two triangles of one plane as one face; none if that is not convex.
    fn join_two(&self, a: u32, b: u32, normal: DVec3) -> Option<Piece> {
        let k = self.side_towards(a, b)?;
        let l = self.side_towards(b, a)?;
        let (of_a, of_b) = (self.indices(a), self.indices(b));
        let ring = [
            of_a[(k + 1) % 3],
            of_a[(k + 2) % 3],
            of_a[k],
            of_b[(l + 2) % 3],
        ];
        let corner = |k: usize| self.is_corner(ring[k], ring[(k + 1) % 4], ring[(k + 2) % 4]);
        if !(0..4).all(corner) {
            let kept: [u32; 3] = self.straighten(&ring, &[])?.try_into().ok()?;
            return Piece::triangle(kept.map(|v| self.vertices[v as usize]), a);
        }
        self.convex_face(&ring, normal, a)
    }

    /// A convex face of three or four corners; none if there are more or they are not convex.
    fn convex_face(&self, ring: &[u32], normal: DVec3, source: u32) -> Option<Piece> {
        let count = ring.len();
        let at = |k: usize| self.vertices[ring[k] as usize];
        let turns = |k: usize| {
            let [p, q, r] = [k, (k + 1) % count, (k + 2) % count].map(at);
            let (along, on) = (q - p, r - q);
            let sine = along.cross(on).dot(normal);
            // Squared: no roots.
            let least = CONVEX * CONVEX * along.length_squared() * on.length_squared();
            sine > 0.0 && sine * sine > least
        };
        if !(0..count).all(turns) {
            return None;
        }
        match count {
            3 => Piece::triangle([0, 1, 2].map(at), source),
            4 => Piece::quadrangle([0, 1, 2, 3].map(at), source),
            _ => None,
        }
    }

    /// A region of several triangles cut anew; none if its outline crosses itself.
    fn triangulate_region(&self, regions: &Regions, id: usize) -> Option<Vec<Piece>> {
        let (source, plane) = (regions.get(id)[0], self.plane(regions, id));
        let [across, up] = plane.axes();
        let flat = |v: u32| {
            let p = self.vertices[v as usize] - plane.origin;
            DVec2::new(p.dot(across), p.dot(up))
        };
        let mut rings = self.straighten_all(&self.loops(regions, id)?);
        if let [ring] = rings.as_slice()
            && let Some(face) = self.convex_face(ring, plane.normal, source)
        {
            return Some(vec![face]);
        }
        // Corners, each once, and the rings as places among them.
        let mut vertices = rings.concat();
        vertices.sort_unstable();
        vertices.dedup();
        for v in rings.iter_mut().flatten() {
            *v = vertices.binary_search(v).ok()? as u32;
        }
        let points: Vec<DVec2> = vertices.iter().map(|v| flat(*v)).collect();
        let (flat, cuts) = polygon::triangulate_compactly(&points, &rings)?;
        let at = |v: &u32| self.vertices[*v as usize];
        let mut corners: Vec<DVec3> = vertices.iter().map(at).collect();
        let added = &flat[corners.len()..];
        corners.extend(added.iter().map(|p| plane.origin + across * p.x + up * p.y));
        let face = |ring: &Vec<u32>| {
            let at = |k: usize| corners[ring[k] as usize];
            match ring.len() {
                3 => Piece::triangle([0, 1, 2].map(at), source),
                _ => Piece::quadrangle([0, 1, 2, 3].map(at), source),
            }
        };
        let rings = pair_triangles(&cuts, &flat);
        Some(rings.iter().filter_map(face).collect())
    }
}

/// The change of area that moving the sides of a face by `flat` may cause.
fn slack(face: &Piece, flat: f64) -> f64 {
    let around: f64 = (0..face.count()).map(|k| face.edge(k).length()).sum();
    1e-9 * face.area + flat * around
}

/// Cuts long faces across, each at most `cuts` times in a row. Cuts go through the midpoints of long
/// edges, so that cuts of neighbouring faces meet. Areas may change where faces are flat up to `flat`.
fn cut_across(faces: Vec<Piece>, cuts: u32, flat: f64) -> Vec<Piece> {
    if cuts == 0 || !faces.iter().any(|f| long_edge(f).is_some()) {
        return faces;
    }
    let (mut done, mut waiting) = (Vec::with_capacity(2 * faces.len()), Vec::new());
    for face in faces {
        waiting.push((face, cuts));
        while let Some((f, cuts)) = waiting.pop() {
            let pieces = long_edge(&f).filter(|_| cuts > 0).map(|k| halves(&f, k));
            match pieces {
                Some([Some(a), Some(b)]) if (a.area + b.area - f.area).abs() <= slack(&f, flat) => {
                    waiting.extend([(a, cuts - 1), (b, cuts - 1)]);
                }
                _ => done.push(f),
            }
        }
    }
    done
}

/// The longest edge of a face, if the face is long along it.
fn long_edge(f: &Piece) -> Option<usize> {
    let length = |k: usize| f.edge(k).length_squared();
    let longest = (0..f.count()).fold(0, |a, k| if length(k) > length(a) { k } else { a });
    (length(longest) > LONG * f.area).then_some(longest)
}

/// A face cut from the middle of its longest edge to that of the opposite edge, of a triangle to
/// that of the next longest edge.
fn halves(f: &Piece, longest: usize) -> [Option<Piece>; 2] {
    let corner = |k: usize| f.corners[(longest + k) % f.count()];
    let middle = |k: usize| 0.5 * (corner(k) + corner(k + 1));
    let (from, [a, b, c]) = (middle(0), [0, 1, 2].map(corner));
    let triangle = |corners| Piece::triangle(corners, f.source);
    let quadrangle = |corners| Piece::quadrangle(corners, f.source);
    if f.count() == 4 {
        let (to, d) = (middle(2), corner(3));
        return [quadrangle([a, from, to, d]), quadrangle([from, b, c, to])];
    }
    let [next, last] = [1, 2].map(|k| f.edge((longest + k) % 3).length_squared());
    if next > last {
        let to = middle(1);
        [triangle([from, b, to]), quadrangle([a, from, to, c])]
    } else {
        let to = middle(2);
        [triangle([a, from, to]), quadrangle([from, b, c, to])]
    }
}

/// Triangles of the points of a plane, joined in pairs to convex quadrangles across their longest
/// common edges.
fn pair_triangles(triangles: &[[u32; 3]], points: &[DVec2]) -> Vec<Vec<u32>> {
    let at = |v: u32| points[v as usize];
    let topology = Topology::new(triangles, points.len());
    let common = topology.edges().filter_map(|edge| {
        let [a, b] = edge.vertices();
        let mut halves = edge.half_edges().iter().copied();
        let upward = halves.find(|h| topology.ends(*h) == [a, b])?;
        Some((-at(a).distance(at(b)), upward, topology.twin(upward)?))
    });
    let mut common: Vec<(f64, HalfEdge, HalfEdge)> = common.collect();
    // Edges are in order of their vertices, and stay so where their lengths are equal.
    common.sort_by(|x, y| x.0.total_cmp(&y.0));
    let mut used = vec![false; triangles.len()];
    let mut rings = Vec::new();
    for (_, upward, downward) in common {
        let ([a, b], [i, j]) = (topology.ends(upward), [upward.face(), downward.face()]);
        let apex = |half: HalfEdge| topology.ends(half.next())[1];
        let (c, d) = (apex(upward), apex(downward));
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

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
