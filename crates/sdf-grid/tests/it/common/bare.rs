//! Bare vertices and triangles, and repair with its defaults.

use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{MeshError, RepairOptions, RepairReport, TriangleMesh, shapes};

/// Repair with its defaults.
pub(crate) fn clean(
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
) -> Result<(TriangleMesh, RepairReport), MeshError> {
    TriangleMesh::clean("part", vertices, triangles, &RepairOptions::default())
}

pub(crate) fn raw(mesh: &TriangleMesh) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    (mesh.vertices().to_vec(), mesh.triangles().to_vec())
}

pub(crate) fn reversed(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
}

pub(crate) fn unit_cube() -> TriangleMesh {
    shapes::cuboid(DVec3::ONE).expect("valid size")
}

/// Vertices and triangles of several meshes in one.
pub(crate) fn joined(meshes: &[&TriangleMesh]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let first = vertices.len() as u32;
        vertices.extend_from_slice(mesh.vertices());
        triangles.extend(mesh.triangles().iter().map(|t| t.map(|i| i + first)));
    }
    (vertices, triangles)
}

pub(crate) fn moved(mesh: &TriangleMesh, offset: DVec3) -> TriangleMesh {
    mesh.transformed(DQuat::IDENTITY, offset)
}

pub(crate) fn scaled(mesh: &TriangleMesh, factor: f64) -> TriangleMesh {
    let vertices = mesh.vertices().iter().map(|v| factor * *v).collect();
    clean(vertices, mesh.triangles().to_vec())
        .expect("a clean mesh")
        .0
}

/// A mesh with several of the faults that repair removes.
pub(crate) fn faulty(seed: u64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut rng = SmallRng::seed_from_u64(seed);
    let sphere = shapes::icosphere(1.0, 4).expect("valid size");
    let torus = shapes::torus(3.0, 0.8, 9, 7).expect("valid size");
    let inner = scaled(&sphere, 0.4);
    let (vertices, triangles) = joined(&[&sphere, &torus, &inner]);
    let mut soup = Vec::new();
    let mut faces = Vec::new();
    for (i, t) in triangles.iter().enumerate() {
        let first = soup.len() as u32;
        soup.extend(t.map(|v| vertices[v as usize]));
        let flip = rng.random_bool(0.3);
        faces.push(if flip {
            [first, first + 2, first + 1]
        } else {
            [first, first + 1, first + 2]
        });
        if i % 17 == 0 {
            faces.push([first + 1, first + 2, first]);
        }
        if i % 23 == 0 {
            faces.push([first, first, first + 1]);
        }
    }
    (soup, faces)
}
