//! A surface in parts without sharp edges.

use std::collections::HashMap;

use glam::DVec3;

use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::face::Face;

/// Triangles whose normals differ by an angle of at least this cosine (25 degrees) may be parts of
/// one smooth surface.
const SMOOTH: f64 = 0.906;

/// Normals that differ by less are one: squared sine.
const SAME: f64 = 1e-12;

/// Triangles in connected parts without sharp edges.
#[derive(Debug)]
pub(super) struct SmoothParts {
    /// The part of each triangle.
    pub(super) of: Vec<u32>,
    /// Which parts are not flat.
    pub(super) bent: Vec<bool>,
    /// The triangle beyond each edge, if there is just one.
    beyond: Vec<[Option<u32>; 3]>,
}

impl SmoothParts {
    pub(super) fn new(mesh: &TriangleMesh) -> Self {
        let normals = mesh.faces().map(Face::normal_and_area);
        let normals: Vec<DVec3> = normals.map(|n| n.unwrap_or_default().0).collect();
        let beyond = neighbours(mesh.triangles());
        let (of, bent) = components(&normals, &beyond);
        Self { of, bent, beyond }
    }

    /// The edges of a triangle at which its part ends, the part to their left.
    pub(super) fn borders(
        &self,
        mesh: &TriangleMesh,
        triangle: usize,
    ) -> impl Iterator<Item = [u32; 2]> + use<> {
        let corners = mesh.triangles()[triangle];
        let part = self.of[triangle];
        let inside = |t: Option<u32>| t.is_some_and(|t| self.of[t as usize] == part);
        let ends = self.beyond[triangle].map(|t| !inside(t));
        let borders = (0..3).filter(move |k| ends[*k]);
        borders.map(move |k| [corners[k], corners[(k + 1) % 3]])
    }
}

/// The triangle beyond each edge, if there is just one.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[Option<u32>; 3]> {
    let mut sides = HashMap::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let side = (corners[k], corners[(k + 1) % 3]);
            let twice = sides.insert(side, t as u32).is_some();
            if twice {
                sides.insert(side, u32::MAX);
            }
        }
    }
    let beyond = |a: u32, b: u32| sides.get(&(b, a)).copied().filter(|t| *t != u32::MAX);
    let of = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| beyond(a, b));
    triangles.iter().map(of).collect()
}

/// The smooth region of each triangle, and which regions are not flat.
fn components(normals: &[DVec3], beyond: &[[Option<u32>; 3]]) -> (Vec<u32>, Vec<bool>) {
    const NONE: u32 = u32::MAX;
    let mut of = vec![NONE; normals.len()];
    let mut bent = Vec::new();
    let mut waiting = Vec::new();
    for seed in 0..normals.len() {
        if of[seed] != NONE {
            continue;
        }
        let id = bent.len() as u32;
        bent.push(false);
        of[seed] = id;
        waiting.push(seed);
        while let Some(t) = waiting.pop() {
            if normals[t].cross(normals[seed]).length_squared() > SAME {
                bent[id as usize] = true;
            }
            for other in beyond[t].iter().flatten() {
                let other = *other as usize;
                if of[other] == NONE && normals[t].dot(normals[other]) >= SMOOTH {
                    of[other] = id;
                    waiting.push(other);
                }
            }
        }
    }
    (of, bent)
}
