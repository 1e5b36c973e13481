//! The faces that a mesh's triangles are merged into.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cut::{cut_across, slack};
use super::outline::{CONVEX, paired};
use super::regions::{LARGE, Regions, Surface};
use crate::mesh::polygon;
use crate::surface::face::Piece;

/// How near to a plane or a line lies in it what differs by rounding alone, in units of the
/// normalized part, whose longest side is 1 to 2: far below any distance that shows in a field.
pub(crate) const EXACT: f64 = 1e-10;

/// Cuts one face can undergo, one after the other.
const MAX_CUTS: u32 = 5;

/// Large meshes are cut less, so that cutting makes no more faces than about this many.
const MAX_PIECES: usize = 100_000;

/// A region is covered anew if its area, less what lies upside down, is at least this share of that
/// of its triangles.
pub(super) const UNFOLDED: f64 = 0.99;

/// What a surface is made of, in lists one after the other: to put them in one would move each once
/// more.
pub(crate) struct Pieces {
    lists: Vec<Vec<Piece>>,
    /// Where each list ends in the order of all.
    ends: Vec<usize>,
    /// Whether the triangles enclose what they enclose without a gap, all the same way round.
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

/// Faces that cover the triangles of corners `vertices[i]`, where what lies within `flat` of a
/// plane lies in it; at least [`EXACT`]. Deterministic.
pub(crate) fn merged(indices: &[[u32; 3]], vertices: &[DVec3], flat: f64) -> Pieces {
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
    // The small ones in the order of the mesh, in which neighbours mostly are not far apart.
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
    Pieces::new(pieces.collect(), surface.closed)
}

impl Surface<'_> {
    fn face(&self, triangle: u32) -> Option<Piece> {
        Piece::triangle(self.corners(triangle), triangle)
    }

    /// Appends faces that cover a region: cut anew, or its triangles where that fails.
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
        // Most regions of curved parts: without a list.
        if let [a, b] = *region
            && let Some(face) = self.pair(a, b, normal)
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
    fn pair(&self, a: u32, b: u32, normal: DVec3) -> Option<Piece> {
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
            let kept: [u32; 3] = self.straightened(&ring, &[])?.try_into().ok()?;
            return Piece::triangle(kept.map(|v| self.vertices[v as usize]), a);
        }
        self.convex(&ring, normal, a)
    }

    /// Three or four corners as a face; none if there are more, or they make no convex one.
    fn convex(&self, ring: &[u32], normal: DVec3, source: u32) -> Option<Piece> {
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
    fn outlined(&self, regions: &Regions, id: usize) -> Option<Vec<Piece>> {
        let (source, plane) = (regions.get(id)[0], self.plane(regions, id));
        let [across, up] = plane.axes();
        let flat = |v: u32| {
            let p = self.vertices[v as usize] - plane.origin;
            DVec2::new(p.dot(across), p.dot(up))
        };
        let mut rings = self.all_straightened(&self.loops(regions, id)?);
        if let [ring] = rings.as_slice()
            && let Some(face) = self.convex(ring, plane.normal, source)
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
        let rings = paired(&cuts, |i| flat[i as usize]);
        Some(rings.iter().filter_map(face).collect())
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
