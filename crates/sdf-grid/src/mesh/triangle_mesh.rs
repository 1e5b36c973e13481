//! Triangle meshes that have been repaired.

use glam::{DQuat, DVec3};

use crate::mesh::aabb::Aabb;
use crate::mesh::decimation::decimate;
use crate::mesh::error::MeshError;
use crate::mesh::measure::{face_area, volume};
use crate::mesh::repair;
use crate::mesh::repair::report::{RepairOptions, RepairReport};
use crate::mesh::topology::Topology;

/// A triangle mesh that has been repaired: finite vertices, indices in range, no zero-area or
/// duplicate faces, components oriented outwards (cavities inwards). Vertices are metres.
///
/// ```
/// use glam::{DQuat, DVec3, dvec3};
/// use sdf_grid::{RepairOptions, TriangleMesh};
///
/// // A tetrahedron, metres.
/// let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let options = RepairOptions::default();
/// let (mesh, report) = TriangleMesh::clean("tetrahedron", vertices, triangles, &options)?;
/// assert!(report.watertight && (mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
/// let moved = mesh.transformed(DQuat::IDENTITY, dvec3(0.0, 0.0, 2.0));
/// assert!((moved.centroid().z - 2.25).abs() < 1e-12);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// Vertices or triangles hashed in one piece.
const HASHED_AT_ONCE: usize = 4096;

impl TriangleMesh {
    /// Cleans raw triangles and keeps what is left.
    ///
    /// In order: vertices must be finite and indices in range; vertices closer than a tolerance are
    /// welded; faces without area and repeated faces are dropped; open edges are cut where the
    /// vertices of others lie on them, so that faces which meet share vertices; the faces of each
    /// component are oriented alike, then outwards (a cavity inwards); what is still open is
    /// measured, and refused when it is too much. The result does not depend on the order of the
    /// input beyond the order of its own vertices and triangles, and a second run changes nothing.
    ///
    /// `name` (a file or part name) appears in every error.
    ///
    /// # Errors
    /// If an option is out of range, there is no face with an area, a vertex is not finite, an
    /// index is out of range, or more of the surface is missing than the options allow.
    pub fn clean(
        name: &str,
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        options: &RepairOptions,
    ) -> Result<(Self, RepairReport), MeshError> {
        let (vertices, triangles, report) = repair::run(name, vertices, triangles, options)?;
        let mesh = Self {
            vertices,
            triangles,
        };
        Ok((mesh, report))
    }

    /// All faces of some meshes as one mesh; where solids touch or overlap, their surfaces stay.
    pub fn joined<'a>(meshes: impl IntoIterator<Item = &'a Self>) -> Self {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for mesh in meshes {
            let first = vertices.len() as u32;
            vertices.extend_from_slice(&mesh.vertices);
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        Self {
            vertices,
            triangles,
        }
    }

    /// The surface in fewer triangles, `off` (metres) away from this one at most in the mean (rms); this
    /// one if nothing would be left.
    pub(crate) fn decimated(&self, off: f64) -> Self {
        let (triangles, vertices) = decimate(&self.triangles, &self.vertices, off);
        if triangles.is_empty() {
            return self.clone();
        }
        let (vertices, triangles) = repair::compact(&vertices, triangles);
        Self {
            vertices,
            triangles,
        }
    }

    /// Vertex positions, metres. Each is used by at least one triangle.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Vertex indices of each triangle, counter-clockwise seen from outside. Never empty.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Which triangles meet along which edges.
    pub fn topology(&self) -> Topology<'_> {
        Topology::new(&self.triangles, self.vertices.len())
    }

    /// Corner positions of triangle `index`, metres.
    ///
    /// # Panics
    /// If `index` is not below the number of triangles.
    pub fn corners(&self, index: usize) -> [DVec3; 3] {
        self.triangles[index].map(|v| self.vertices[v as usize])
    }

    /// Corner positions of all triangles in order, metres.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = [DVec3; 3]> + '_ {
        (0..self.triangles.len()).map(|i| self.corners(i))
    }

    /// The smallest box around all vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::around(self.vertices.iter().copied())
    }

    /// Enclosed volume, cubic metres; of an open mesh, the volume enclosed once fans about the
    /// centre of the bounds close it.
    pub fn volume(&self) -> f64 {
        volume(&self.vertices, &self.triangles)
    }

    /// Surface area, square metres.
    pub fn area(&self) -> f64 {
        self.faces().map(face_area).sum()
    }

    /// Centroid of the enclosed solid, metres; of the surface if the solid is flat or open enough
    /// to have no volume.
    pub fn centroid(&self) -> DVec3 {
        let bounds = self.bounds();
        let reference = bounds.center();
        let (mut volume, mut moment) = (0.0, DVec3::ZERO);
        let (mut area, mut area_moment) = (0.0, DVec3::ZERO);
        for [a, b, c] in self.faces().map(|f| f.map(|p| p - reference)) {
            let v = a.dot(b.cross(c)) / 6.0;
            volume += v;
            moment += v * 0.25 * (a + b + c);
            let s = face_area([a, b, c]);
            area += s;
            area_moment += s * (a + b + c) / 3.0;
        }
        if volume.abs() > 1e-9 * area * bounds.diagonal() {
            reference + moment / volume
        } else {
            reference + area_moment / area
        }
    }

    /// Largest distance of a vertex from `center`, metres.
    pub fn radius_about(&self, center: DVec3) -> f64 {
        self.vertices
            .iter()
            .map(|v| v.distance_squared(center))
            .fold(0.0, f64::max)
            .sqrt()
    }

    /// BLAKE3 hash of the vertices and triangles: the key of caches and tables.
    ///
    /// It depends on the order of both and on every bit of the coordinates (-0 counts as 0).
    pub fn hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"pegfit triangle mesh 1");
        hasher.update(&(self.vertices.len() as u64).to_le_bytes());
        hasher.update(&(self.triangles.len() as u64).to_le_bytes());
        // The hash takes long pieces several times as fast as single numbers.
        let mut bytes = Vec::with_capacity(24 * HASHED_AT_ONCE);
        for vertices in self.vertices.chunks(HASHED_AT_ONCE) {
            bytes.clear();
            let numbers = vertices.iter().flat_map(|v| v.to_array());
            bytes.extend(numbers.flat_map(|x| (x + 0.0).to_le_bytes()));
            hasher.update(&bytes);
        }
        for triangles in self.triangles.chunks(HASHED_AT_ONCE) {
            bytes.clear();
            bytes.extend(triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
            hasher.update(&bytes);
        }
        *hasher.finalize().as_bytes()
    }

    /// The mesh moved by `p -> rotation * p + translation` (unit quaternion, metres).
    #[must_use]
    pub fn transformed(&self, rotation: DQuat, translation: DVec3) -> Self {
        Self {
            vertices: self
                .vertices
                .iter()
                .map(|&v| rotation * v + translation)
                .collect(),
            triangles: self.triangles.clone(),
        }
    }
}
