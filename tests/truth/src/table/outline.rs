//! The flat faces of a part by their outlines.

use std::collections::HashMap;

use glam::DVec3;
use sdf_grid::TriangleMesh;

use crate::geometry::facet::Faces;
use crate::geometry::plane::Plane;

/// All of a part's surface in one plane.
#[derive(Debug, Clone)]
pub(super) struct Outline {
    pub(super) plane: Plane,
    pub(super) edges: Vec<Edge>,
    centre: DVec3,
    radius: f64,
}

/// A straight edge; the surface lies to its left, seen from outside.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub(super) start: DVec3,
    /// Unit vector.
    pub(super) along: DVec3,
    /// Unit vector in the plane, away from the surface.
    pub(super) outward: DVec3,
    /// Metres.
    pub(super) length: f64,
}

impl Outline {
    /// The outlines of a mesh: edges between triangles of one plane are none.
    pub(super) fn from_mesh(mesh: &TriangleMesh, faces: &Faces) -> Vec<Self> {
        let mut sides: HashMap<(u32, u32, u32), i32> = HashMap::new();
        for (plane, triangle) in faces.triangles(mesh) {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                *sides.entry((plane, a, b)).or_default() += 1;
                *sides.entry((plane, b, a)).or_default() -= 1;
            }
        }
        let mut ends: Vec<Vec<(u32, u32)>> = vec![Vec::new(); faces.planes.len()];
        for ((plane, a, b), count) in sides {
            for _ in 0..count {
                ends[plane as usize].push((a, b));
            }
        }
        let outlines = faces.planes.iter().zip(ends);
        outlines
            .map(|(plane, mut ends)| {
                // Sums are taken in an order that does not change from run to run.
                ends.sort_unstable();
                let point = |v: u32| mesh.vertices()[v as usize];
                let corners = ends.iter().map(|e| point(e.0));
                let centre = corners.clone().sum::<DVec3>() / ends.len().max(1) as f64;
                let radius = corners.map(|p| p.distance(centre)).fold(0.0, f64::max);
                Self {
                    plane: *plane,
                    edges: ends
                        .iter()
                        .map(|(a, b)| Edge::new(plane, point(*a), point(*b)))
                        .collect(),
                    centre,
                    radius,
                }
            })
            .collect()
    }

    /// Whether any of it may lie nearer to `p` than `reach`.
    pub(super) fn is_near(&self, p: DVec3, reach: f64) -> bool {
        self.plane.height(p).abs() < reach && p.distance(self.centre) < self.radius + reach
    }
}

impl Edge {
    fn new(plane: &Plane, start: DVec3, end: DVec3) -> Self {
        let along = (end - start).normalize_or_zero();
        Self {
            start,
            along,
            outward: along.cross(plane.normal),
            length: start.distance(end),
        }
    }
}
