//! Points of a surface that tell whether a turn brings it onto itself.

use glam::DVec3;

use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Vertices taken at most, spread evenly over the vertex list.
const MAX_VERTICES: usize = 1000;
/// Points on faces, spread evenly over the area.
const ON_FACES: usize = 1000;

/// Sample points relative to a centre.
pub(super) struct Samples {
    /// Their offsets from the centre, metres, farthest first: those fail soonest.
    pub(super) offsets: Vec<DVec3>,
    /// Distance of the farthest, metres.
    pub(super) radius: f64,
}

impl Samples {
    /// Vertices and points on faces of `mesh`, always the same ones.
    pub(super) fn of(mesh: &TriangleMesh, center: DVec3) -> Self {
        let stride = mesh.vertices().len().div_ceil(MAX_VERTICES);
        let mut offsets: Vec<DVec3> = mesh
            .vertices()
            .iter()
            .step_by(stride)
            .copied()
            .chain(on_faces(mesh))
            .map(|p| p - center)
            .collect();
        offsets.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        Self {
            radius: mesh.radius_about(center),
            offsets,
        }
    }
}

/// Points at equal steps of area along the face list, placed within each face by a sequence that
/// fills the unit square evenly (Roberts' R2).
fn on_faces(mesh: &TriangleMesh) -> Vec<DVec3> {
    let step = mesh.area() / ON_FACES as f64;
    let mut points = Vec::with_capacity(ON_FACES);
    let mut passed = 0.0;
    for face in mesh.faces() {
        passed += face_area(face);
        while points.len() < ON_FACES && (points.len() as f64 + 0.5) * step < passed {
            let k = points.len() as f64;
            let (s, t) = ((k * 0.7548776662).fract(), (k * 0.5698402910).fract());
            let [a, b, c] = face;
            let u = s.sqrt();
            points.push((1.0 - u) * a + u * (1.0 - t) * b + u * t * c);
        }
    }
    points
}
