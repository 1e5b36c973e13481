//! Validated closed oriented triangle meshes and the hygiene that makes them.

use glam::{DQuat, DVec3};

/// An axis-aligned box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Lowest corner.
    pub min: DVec3,
    /// Highest corner.
    pub max: DVec3,
}

/// A triangle mesh that has passed hygiene: finite vertices, indices in range, no zero-area or
/// duplicate faces, components oriented outwards. Vertices are metres.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// What hygiene found and changed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HygieneReport {}

/// Why a mesh cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// placeholder
    #[error("placeholder")]
    Placeholder,
}

impl TriangleMesh {
    /// Vertex positions, metres.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Corner positions of triangle `index`, metres.
    pub fn corners(&self, index: usize) -> [DVec3; 3] {
        self.triangles[index].map(|v| self.vertices[v as usize])
    }

    /// The smallest box around all vertices.
    pub fn bounds(&self) -> Aabb {
        todo!()
    }

    /// Enclosed volume, cubic metres.
    pub fn volume(&self) -> f64 {
        todo!()
    }

    /// BLAKE3 hash of the vertices and triangles: the key of caches and tables.
    pub fn hash(&self) -> [u8; 32] {
        todo!()
    }

    /// The mesh moved by `p -> rotation * p + translation`.
    #[must_use]
    pub fn transformed(&self, rotation: DQuat, translation: DVec3) -> Self {
        let _ = (rotation, translation);
        todo!()
    }
}
