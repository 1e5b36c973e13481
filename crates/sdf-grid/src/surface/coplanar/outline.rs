//! Planar regions as polygons with holes.

use glam::DVec3;
use rayon::prelude::*;

use super::regions::{Regions, Surface};

/// A region is triangulated anew if its signed area is at least this share of the area of its
/// triangles.
pub(super) const UNFOLDED: f64 = 0.99;

/// Straightening evaluates every corner of a ring a few times, but those of a comb once per tooth:
/// rings that take more evaluations per corner stay as they are.
const MOST_LOOKS: usize = 200;

/// Areas of an outline and of its triangles may differ by this share of the area around it.
const SAME: f64 = 1e-6;

/// A flat part of a surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outline {
    /// A point of its plane.
    pub(crate) origin: DVec3,
    /// Unit normal, outwards.
    pub(crate) normal: DVec3,
    /// Closed chains of corners in the plane, the region to their left seen from outside.
    pub(crate) rings: Vec<Vec<DVec3>>,
}

/// The planar regions of a surface as polygons. Corners within `flat` of a common plane or straight
/// line count as lying in it. Deterministic.
pub(crate) fn outlines(indices: &[[u32; 3]], vertices: &[DVec3], flat: f64) -> Vec<Outline> {
    let surface = Surface::new(indices, vertices, flat);
    let regions = surface.regions();
    let found = (0..regions.count()).into_par_iter().map(|id| {
        let region = regions.get(id);
        let outline = match region {
            [_] => None,
            _ => surface.region_outline(&regions, id),
        };
        match outline {
            Some(outline) => vec![outline],
            None => region
                .iter()
                .filter_map(|t| surface.triangle_outline(*t))
                .collect(),
        }
    });
    found.collect::<Vec<_>>().concat()
}

impl Surface<'_> {
    /// The closed chains of corners around a region, the region to their left; see
    /// [`Topology::outlines`](crate::mesh::topology::Topology::outlines).
    pub(super) fn loops(&self, regions: &Regions, id: usize) -> Option<Vec<Vec<u32>>> {
        let inside = |t: usize| regions.of[t] == id as u32;
        self.topology.outlines(regions.get(id), inside)
    }

    /// Whether `b` lies off the segment from `a` to `c`.
    pub(super) fn is_corner(&self, a: u32, b: u32, c: u32) -> bool {
        self.off_line(a, b, c) > self.flat * self.flat
    }

    /// Squared distance of `b` from the segment from `a` to `c`.
    fn off_line(&self, a: u32, b: u32, c: u32) -> f64 {
        let at = |v: u32| self.vertices[v as usize];
        let (along, from) = (at(c) - at(a), at(b) - at(a));
        let place = from.dot(along) / along.length_squared();
        // A segment without length: the distance from its end.
        let place = if place.is_nan() { 0.0 } else { place };
        from.distance_squared(along * place.clamp(0.0, 1.0))
    }

    /// Rings without the corners on straight sides. Corners in which rings touch stay: without them
    /// one ring might cross the other.
    pub(super) fn straighten_all(&self, rings: &[Vec<u32>]) -> Vec<Vec<u32>> {
        let mut corners = rings.concat();
        corners.sort_unstable();
        let touching = corners.windows(2).filter(|w| w[0] == w[1]).map(|w| w[0]);
        let touching: Vec<u32> = touching.collect();
        let straight = |ring: &Vec<u32>| {
            let straight = self.straighten(ring, &touching);
            straight.unwrap_or_else(|| ring.clone())
        };
        rings.iter().map(straight).collect()
    }

    /// A ring without the corners on straight sides, all within `flat` of the rest (Douglas and
    /// Peucker); none if fewer than three corners are left or it takes too long. Corners in `keep`
    /// (sorted) stay.
    pub(super) fn straighten(&self, ring: &[u32], keep: &[u32]) -> Option<Vec<u32>> {
        let at = |k: usize| self.vertices[ring[k] as usize];
        let farthest = |from: DVec3| {
            (0..ring.len()).max_by(|a, b| {
                let [a, b] = [*a, *b].map(|k| from.distance_squared(at(k)));
                a.total_cmp(&b)
            })
        };
        // The point farthest from any other is a corner.
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

impl Surface<'_> {
    fn triangle_outline(&self, triangle: u32) -> Option<Outline> {
        let facet = self.facets[triangle as usize];
        let corners = self.corners(triangle);
        (facet.area > 0.0).then(|| Outline {
            origin: corners[0],
            normal: facet.normal,
            rings: vec![corners.to_vec()],
        })
    }

    /// A region as one polygon; none if its outline is not that of its triangles.
    fn region_outline(&self, regions: &Regions, id: usize) -> Option<Outline> {
        let plane = self.plane(regions, id);
        let rings = self.straighten_all(&self.loops(regions, id)?);
        let flat = |v: &u32| {
            let p = self.vertices[*v as usize];
            p - plane.normal * (p - plane.origin).dot(plane.normal)
        };
        let rings: Vec<Vec<DVec3>> = rings.iter().map(|r| r.iter().map(flat).collect()).collect();
        let facets = || regions.get(id).iter().map(|t| &self.facets[*t as usize]);
        let covered: f64 = facets().map(|f| f.area * f.normal.dot(plane.normal)).sum();
        let folded = covered < UNFOLDED * facets().map(|f| f.area).sum::<f64>();
        let area: f64 = rings.iter().map(|r| area(r, plane.normal)).sum();
        let around: f64 = rings.iter().map(|r| length(r)).sum();
        let same = (area - covered).abs() <= SAME * covered + self.flat * around;
        (same && !folded && area > 0.0).then_some(Outline {
            origin: plane.origin,
            normal: plane.normal,
            rings,
        })
    }
}

fn sides(ring: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let next = ring.iter().cycle().skip(1);
    ring.iter().copied().zip(next.copied())
}

fn area(ring: &[DVec3], normal: DVec3) -> f64 {
    let from = ring[0];
    let twice = |(a, b): (DVec3, DVec3)| (a - from).cross(b - from).dot(normal);
    0.5 * sides(ring).map(twice).sum::<f64>()
}

fn length(ring: &[DVec3]) -> f64 {
    sides(ring).map(|(a, b)| a.distance(b)).sum()
}
