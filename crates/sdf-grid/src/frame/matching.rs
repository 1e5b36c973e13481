//! Rotations that may carry one part onto another, and samples that tell whether they do.

use glam::{DMat3, DQuat, DVec3};

use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Pairs of far-out vertices compared at most; beyond, the part is round or has so many equal
/// corners that its principal axes have to do.
const MAX_PAIRS: usize = 1 << 16;

/// All rotations that carry two vertices of one part to two of another, each about its centre: the
/// farthest one from the centre, and the one that spans the widest triangle with it.
pub(super) fn vertex_rotations(
    from: (&TriangleMesh, DVec3),
    to: (&TriangleMesh, DVec3),
    tolerance: f64,
) -> Vec<DQuat> {
    let [points, others] = [from, to].map(|(mesh, centre)| -> Vec<DVec3> {
        mesh.vertices().iter().map(|v| *v - centre).collect()
    });
    let Some(&first) = points
        .iter()
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    else {
        return Vec::new();
    };
    let span = |p: &DVec3| first.cross(*p).length_squared();
    let Some(&second) = points.iter().max_by(|a, b| span(a).total_cmp(&span(b))) else {
        return Vec::new();
    };
    let as_far_as = |p: DVec3| -> Vec<DVec3> {
        let near = |q: &&DVec3| (q.length() - p.length()).abs() <= tolerance;
        others.iter().filter(near).copied().collect()
    };
    let (firsts, seconds) = (as_far_as(first), as_far_as(second));
    if firsts.len() * seconds.len() > MAX_PAIRS {
        return Vec::new();
    }
    let distance = first.distance(second);
    let mut rotations = Vec::new();
    for &a in &firsts {
        for &b in &seconds {
            if (a.distance(b) - distance).abs() <= 2.0 * tolerance {
                rotations.extend(rotation([first, second], [a, b]));
            }
        }
    }
    rotations
}

/// The rotation that carries the frame of one pair of vectors to that of another.
fn rotation(from: [DVec3; 2], to: [DVec3; 2]) -> Option<DQuat> {
    let frame = |[a, b]: [DVec3; 2]| -> Option<DMat3> {
        let x = a.try_normalize()?;
        let z = a.cross(b).try_normalize()?;
        Some(DMat3::from_cols(x, z.cross(x), z))
    };
    Some(DQuat::from_mat3(&(frame(to)? * frame(from)?.transpose())))
}

/// Vertices taken at most, spread evenly over the vertex list.
const MAX_VERTICES: usize = 1000;
/// Points on faces, spread evenly over the area.
const ON_FACES: usize = 1000;

/// Sample points relative to a centre.
pub(super) struct SurfaceSamples {
    /// Their offsets from the centre, metres, farthest first: those fail soonest.
    pub(super) offsets: Vec<DVec3>,
    /// Distance of the farthest, metres.
    pub(super) radius: f64,
}

impl SurfaceSamples {
    /// Vertices and points on faces of `mesh`, always the same ones.
    pub(super) fn new(mesh: &TriangleMesh, center: DVec3) -> Self {
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
