//! Principal axes of a surface.

use glam::{DMat3, DVec3};

use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// The principal axes of the surface's second moments about `center`.
pub(super) fn principal_axes(mesh: &TriangleMesh, center: DVec3) -> [DVec3; 3] {
    principal_moments(mesh, center).map(|(_, axis)| axis)
}

/// The surface's second moments about `center`, in no order, each with its axis.
pub(super) fn principal_moments(mesh: &TriangleMesh, center: DVec3) -> [(f64, DVec3); 3] {
    let mut moments = DMat3::ZERO;
    for face in mesh.faces() {
        let area = face_area(face);
        let [a, b, c] = face.map(|p| p - center);
        let middle = a + b + c;
        for v in [a, b, c, middle] {
            // The integral of p pᵀ over a triangle is area / 12 times this sum.
            moments += outer(v) * (area / 12.0);
        }
    }
    eigen(moments)
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Eigenvalues and eigenvectors of a symmetric matrix by cyclic Jacobi rotations.
fn eigen(mut m: DMat3) -> [(f64, DVec3); 3] {
    let mut vectors = DMat3::IDENTITY;
    // Convergence is quadratic: a handful of sweeps reaches rounding for any 3 x 3 matrix.
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = m.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let ratio = (m.col(q)[q] - m.col(p)[p]) / (2.0 * off);
            let tangent = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cosine;
            turn.col_mut(q)[q] = cosine;
            turn.col_mut(p)[q] = -sine;
            turn.col_mut(q)[p] = sine;
            m = turn.transpose() * m * turn;
            vectors *= turn;
        }
    }
    [0, 1, 2].map(|k| (m.col(k)[k], vectors.col(k)))
}
