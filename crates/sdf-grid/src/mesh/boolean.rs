//! Exact booleans of closed surfaces, by `boolmesh`.

use std::panic::{AssertUnwindSafe, catch_unwind};

use boolmesh::prelude::{Manifold, OpType, compute_boolean};
use glam::DVec3;

use crate::mesh::measure::{face_area, volume};

/// A closed surface that booleans take.
#[derive(Debug)]
pub(crate) struct ClosedSurface {
    surface: Manifold,
}

/// The intersection of two solids.
pub(crate) enum Intersection {
    /// Nothing, or faces only.
    Nothing,
    /// The surface of the intersection.
    Solid(Box<ClosedSurface>),
}

impl ClosedSurface {
    /// The surface of these triangles; none unless each edge joins two triangles that run alike.
    pub(crate) fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let positions: Vec<f64> = vertices.iter().flat_map(|v| v.to_array()).collect();
        let corners: Vec<usize> = triangles.iter().flatten().map(|&v| v as usize).collect();
        let surface = guarded(|| Manifold::new(&positions, &corners))?;
        Some(Self { surface })
    }

    /// The union of both; none if the library fails.
    pub(crate) fn union(&self, other: &Self) -> Option<Self> {
        let surface = guarded(|| compute_boolean(&self.surface, &other.surface, OpType::Add))?;
        Some(Self { surface })
    }

    /// The intersection of both; none if the library fails.
    pub(crate) fn intersection(&self, other: &Self) -> Option<Intersection> {
        let common = guarded(|| compute_boolean(&self.surface, &other.surface, OpType::Intersect));
        if let Some(surface) = common {
            return Some(Intersection::Solid(Box::new(Self { surface })));
        }
        // The library refuses to return an empty surface. Solids that share nothing add up.
        let sum = self.volume() + other.volume();
        let union = self.union(other)?;
        ((union.volume() - sum).abs() <= 1e-9 * sum).then_some(Intersection::Nothing)
    }

    /// Its vertices and triangles.
    pub(crate) fn mesh(&self) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        (self.vertices(), self.triangles())
    }

    fn vertices(&self) -> Vec<DVec3> {
        let vertices = self.surface.ps.iter();
        vertices.map(|v| DVec3::new(v.x, v.y, v.z)).collect()
    }

    fn triangles(&self) -> Vec<[u32; 3]> {
        let (triangles, _) = self.surface.hs.as_chunks::<3>();
        let triangles = triangles
            .iter()
            .map(|t| t.each_ref().map(|c| c.tail as u32));
        triangles.collect()
    }

    /// Enclosed volume, cubic units.
    pub(crate) fn volume(&self) -> f64 {
        let (vertices, triangles) = self.mesh();
        volume(&vertices, &triangles)
    }

    /// Area, square units.
    pub(crate) fn area(&self) -> f64 {
        let (vertices, triangles) = self.mesh();
        let corner = |v: u32| vertices[v as usize];
        triangles.iter().map(|t| face_area(t.map(corner))).sum()
    }
}

/// The library's answer; none if it returns an error or panics.
fn guarded(boolean: impl FnOnce() -> Result<Manifold, String>) -> Option<Manifold> {
    catch_unwind(AssertUnwindSafe(boolean)).ok()?.ok()
}
