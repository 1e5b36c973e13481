//! Flat regions as polygons with holes.

use glam::DVec3;
use rayon::prelude::*;

use super::pieces::UNFOLDED;
use super::regions::{Regions, Surface};

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

/// The surface of the triangles with corners `vertices[i]` as flat polygons, where what lies within
/// `flat` of a plane or of a straight line lies in it. Deterministic.
pub(crate) fn outlines(indices: &[[u32; 3]], vertices: &[DVec3], flat: f64) -> Vec<Outline> {
    let surface = Surface::new(indices, vertices, flat);
    let regions = surface.regions();
    let found = (0..regions.count()).into_par_iter().map(|id| {
        let region = regions.get(id);
        let whole = match region {
            [_] => None,
            _ => surface.whole(&regions, id),
        };
        match whole {
            Some(outline) => vec![outline],
            None => region.iter().filter_map(|t| surface.alone(*t)).collect(),
        }
    });
    found.collect::<Vec<_>>().concat()
}

impl Surface<'_> {
    fn alone(&self, triangle: u32) -> Option<Outline> {
        let facet = self.facets[triangle as usize];
        let corners = self.corners(triangle);
        (facet.area > 0.0).then(|| Outline {
            origin: corners[0],
            normal: facet.normal,
            rings: vec![corners.to_vec()],
        })
    }

    /// A region as one polygon; none if its outline is not that of its triangles.
    fn whole(&self, regions: &Regions, id: usize) -> Option<Outline> {
        let plane = self.plane(regions, id);
        let rings = self.all_straightened(&self.loops(regions, id)?);
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
