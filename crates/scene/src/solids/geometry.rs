//! What a link or body of a robot's description is made of.

use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::mesh_io::ReadOptions;
use sdf_grid::{HygieneOptions, LengthUnit, MeshError, TriangleMesh, mesh_io, shapes};

/// Edges around a full turn of cylinders.
const SEGMENTS: u32 = 64;

/// Cuts of each face of the icosahedron that a sphere is made of.
const SUBDIVISIONS: u32 = 16;

/// A shape of a robot's description.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    /// Of its link or body.
    pub(super) name: String,
    /// Number of its link or body.
    pub(super) group: usize,
    pub(super) pose: Pose,
    pub(super) geometry: Geometry,
}

/// What it is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Geometry {
    /// A mesh file whose coordinates times `scale` are metres.
    Mesh { path: PathBuf, scale: DVec3 },
    /// Edges, metres.
    Box(DVec3),
    /// About z, metres.
    Cylinder { radius: f64, height: f64 },
    /// Metres.
    Sphere(f64),
}

impl Geometry {
    /// Its surface in metres.
    pub(super) fn mesh(&self) -> Result<TriangleMesh, MeshError> {
        match self {
            Self::Mesh { path, scale } => scaled(path, *scale),
            Self::Box(size) => shapes::cuboid(*size),
            Self::Cylinder { radius, height } => shapes::cylinder(*radius, *height, SEGMENTS),
            Self::Sphere(radius) => shapes::icosphere(*radius, SUBDIVISIONS),
        }
    }
}

/// A mesh file whose coordinates are stretched along its axes; a mirrored one is turned inside out
/// again by cleaning.
fn scaled(path: &Path, scale: DVec3) -> Result<TriangleMesh, MeshError> {
    let options = ReadOptions {
        unit: LengthUnit::M,
        ..ReadOptions::default()
    };
    let (mesh, _) = mesh_io::read_with(path, &options)?;
    if scale == DVec3::ONE {
        return Ok(mesh);
    }
    let vertices = mesh.vertices().iter().map(|v| *v * scale).collect();
    let name = path.display().to_string();
    let triangles = mesh.triangles().to_vec();
    Ok(TriangleMesh::clean(&name, vertices, triangles, &HygieneOptions::default())?.0)
}
