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

/// Faces whose longest edge, squared, exceeds their area this many times are cut across.
const LONG: f64 = 8.0;

/// Cuts one face can undergo, one after the other.
const MAX_CUTS: u32 = 5;

/// Large meshes are cut less, so that cutting makes no more faces than about this many.
const MAX_PIECES: usize = 200_000;

const NONE: u32 = u32::MAX;

/// Faces that cover the triangles with corners `corner(i)`. Deterministic.
pub(crate) fn merged(indices: &[[u32; 3]], vertices: &[DVec3]) -> Vec<Face> {
    let triangles: Vec<Option<Face>> = (indices.par_iter().enumerate())
        .map(|(i, t)| Face::triangle(t.map(|v| vertices[v as usize]), i as u32))
        .collect();
    let surface = Surface {
        neighbours: neighbours(indices),
        indices,
        vertices,
        triangles,
    };
    let (regions, region_of) = surface.regions();
    let outlined = |(id, region): (usize, &Vec<u32>)| {
        let faces = surface.outlined(region, id as u32, &region_of);
        faces.unwrap_or_else(|| surface.plain(region))
    };
    let faces: Vec<Vec<Face>> = regions.par_iter().enumerate().map(outlined).collect();
    let faces = faces.concat();
    let cuts = (MAX_PIECES / faces.len().max(1))
        .checked_ilog2()
        .unwrap_or(0);
    let pieces: Vec<Vec<Face>> = (faces.par_iter())
        .map(|f| cut_across(f, cuts.min(MAX_CUTS)))
        .collect();
    pieces.concat()
}

/// The mesh with what lies beside each triangle.
struct Surface<'a> {
    indices: &'a [[u32; 3]],
    vertices: &'a [DVec3],
    /// None without area.
    triangles: Vec<Option<Face>>,
    /// The triangle beyond edge `k`, or [`NONE`].
    neighbours: Vec<[u32; 3]>,
}

/// The triangle beyond each edge: the one other triangle that has it, the other way round.
fn neighbours(indices: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let edge = |i: usize, k: usize| (indices[i][k], indices[i][(k + 1) % 3]);
    let mut halves: Vec<([u32; 2], u32)> = (0..indices.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            (0..3).map(move |k| {
                let (a, b) = edge(i, k);
                ([a.min(b), a.max(b)], (3 * i + k) as u32)
            })
        })
        .collect();
    halves.par_sort_unstable();
    let mut beyond = vec![[NONE; 3]; indices.len()];
    for pair in halves.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, x), (_, y)] = *pair {
            let place = |h: u32| (h as usize / 3, h as usize % 3);
            let ((i, k), (j, l)) = (place(x), place(y));
            if edge(i, k).0 != edge(j, l).0 {
                beyond[i][k] = j as u32;
                beyond[j][l] = i as u32;
            }
        }
    }
    beyond
}

impl Surface<'_> {
    /// Connected flat regions, grown from the largest triangle on, and each triangle's region.
    fn regions(&self) -> (Vec<Vec<u32>>, Vec<u32>) {
        let mut seeds: Vec<(f64, u32)> = self
            .triangles
            .iter()
            .flatten()
            .map(|t| (-t.area, t.source))
            .collect();
        seeds.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut region_of = vec![NONE; self.indices.len()];
        let mut regions: Vec<Vec<u32>> = Vec::new();
        for (_, seed) in seeds {
            if region_of[seed as usize] != NONE {
                continue;
            }
            let Some(plane) = &self.triangles[seed as usize] else {
                continue;
            };
            let id = regions.len() as u32;
            let mut region = vec![seed];
            region_of[seed as usize] = id;
            let mut next = 0;
            while let Some(&t) = region.get(next) {
                next += 1;
                for n in self.neighbours[t as usize] {
                    if n != NONE && region_of[n as usize] == NONE && self.lies_in(n, plane) {
                        region_of[n as usize] = id;
                        region.push(n);
                    }
                }
            }
            regions.push(region);
        }
        (regions, region_of)
    }

    fn lies_in(&self, triangle: u32, plane: &Face) -> bool {
        let Some(t) = &self.triangles[triangle as usize] else {
            return false;
        };
        t.normal.dot(plane.normal) > 0.9
            && t.outline().iter().all(|c| plane.height(*c).abs() <= FLAT)
    }

    /// The triangles of a region as they are.
    fn plain(&self, region: &[u32]) -> Vec<Face> {
        let triangles = region.iter().filter_map(|t| self.triangles[*t as usize]);
        triangles.collect()
    }

    /// A region of several triangles cut anew; none if its outline touches itself.
    fn outlined(&self, region: &[u32], id: u32, region_of: &[u32]) -> Option<Vec<Face>> {
        let seed = (region.len() > 1).then(|| self.triangles[region[0] as usize])??;
        let (across, up) = (seed.along[0], seed.normal.cross(seed.along[0]));
        let flat = |v: u32| {
            let p = self.vertices[v as usize] - seed.corners[0];
            DVec2::new(p.dot(across), p.dot(up))
        };
        let loops = self.loops(region, id, region_of)?;
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
        let faces: Vec<Face> = paired(&cuts, |i| flat[i as usize])
            .iter()
            .filter_map(|ring| {
                let at = |k: usize| corners[ring[k] as usize];
                match ring.len() {
                    3 => Face::triangle([at(0), at(1), at(2)], seed.source),
                    _ => Face::quadrangle([at(0), at(1), at(2), at(3)], seed.source),
                }
            })
            .collect();
        let area = |f: &[Face]| f.iter().map(|t| t.area).sum::<f64>();
        let (before, after) = (area(&self.plain(region)), area(&faces));
        ((before - after).abs() <= 1e-9 * before).then_some(faces)
    }

    /// The closed chains of edges around a region, without corners on straight sides; none if one
    /// vertex is passed twice.
    fn loops(&self, region: &[u32], id: u32, region_of: &[u32]) -> Option<Vec<Vec<u32>>> {
        let mut next: HashMap<u32, u32> = HashMap::new();
        let mut starts = Vec::new();
        for &t in region {
            let corners = self.indices[t as usize];
            for (k, beyond) in self.neighbours[t as usize].into_iter().enumerate() {
                if beyond == NONE || region_of[beyond as usize] != id {
                    starts.push(corners[k]);
                    if next.insert(corners[k], corners[(k + 1) % 3]).is_some() {
                        return None;
                    }
                }
            }
        }
        let mut loops = Vec::new();
        for start in starts {
            let mut ring = Vec::new();
            let mut at = start;
            while let Some(to) = next.remove(&at) {
                ring.push(at);
                at = to;
            }
            if at != start {
                return None;
            }
            if !ring.is_empty() {
                loops.push(self.straightened(&ring)?);
            }
        }
        Some(loops)
    }

    /// A ring without the corners on straight sides; none if nothing is left.
    fn straightened(&self, ring: &[u32]) -> Option<Vec<u32>> {
        let at = |v: u32| self.vertices[v as usize];
        let is_corner = |a: u32, b: u32, c: u32| {
            let (along, from) = (at(c) - at(a), at(b) - at(a));
            let length = along.length();
            from.dot(along) <= 0.0
                || from.dot(along) >= length * length
                || from.cross(along).length() > STRAIGHT * length
        };
        let n = ring.len();
        let first =
            (0..n).find(|&i| is_corner(ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]))?;
        let mut kept = vec![ring[first]];
        for i in 1..n {
            let (b, c) = (ring[(first + i) % n], ring[(first + i + 1) % n]);
            if is_corner(*kept.last()?, b, c) {
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
            (q - p).perp_dot(r - q) > 1e-9 * (q - p).length() * (r - q).length()
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

/// The face in pieces that are not long, after `cuts` cuts one after the other at most. Cuts go through
/// the middles of long edges, so that those of neighbours meet.
fn cut_across(face: &Face, cuts: u32) -> Vec<Face> {
    let mut done = Vec::new();
    let mut waiting = vec![(*face, cuts)];
    while let Some((f, cuts)) = waiting.pop() {
        let longest = (0..f.count).fold(0, |a, k| if f.length[k] > f.length[a] { k } else { a });
        let length = f.length[longest];
        if cuts == 0 || length * length <= LONG * f.area {
            done.push(f);
            continue;
        }
        let pieces: Vec<Face> = halves(&f, longest).into_iter().flatten().collect();
        let area: f64 = pieces.iter().map(|p| p.area).sum();
        if pieces.len() == 2 && (area - f.area).abs() <= 1e-9 * f.area {
            waiting.extend(pieces.into_iter().map(|p| (p, cuts - 1)));
        } else {
            done.push(f);
        }
    }
    done
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
