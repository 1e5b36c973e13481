//! Directions in which a symmetry axis may lie.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};

use super::MAX_ORDER;
use crate::mesh::{TriangleMesh, face_area};

/// Pairs of far-out vertices compared at most; beyond, the part is round or has so many equal
/// corners that its principal axes have to do.
const MAX_PAIRS: usize = 1 << 16;

/// The principal axes of the surface's second moments about `center`.
pub(crate) fn principal_axes(mesh: &TriangleMesh, center: DVec3) -> [DVec3; 3] {
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
    eigenvectors(moments)
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Eigenvectors of a symmetric matrix by cyclic Jacobi rotations.
fn eigenvectors(mut m: DMat3) -> [DVec3; 3] {
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
    [vectors.x_axis, vectors.y_axis, vectors.z_axis]
}

/// A rotation that may be a symmetry.
pub(super) struct Turn {
    /// Unit vector along the axis.
    pub(super) axis: DVec3,
    /// Angle, radians.
    pub(super) angle: f64,
}

/// All rotations that carry two vertices to two others: the farthest one from the centre, and the
/// one that spans the widest triangle with it.
pub(super) fn vertex_turns(mesh: &TriangleMesh, center: DVec3, tolerance: f64) -> Vec<Turn> {
    let points: Vec<DVec3> = mesh.vertices().iter().map(|v| *v - center).collect();
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
        points.iter().filter(near).copied().collect()
    };
    let (firsts, seconds) = (as_far_as(first), as_far_as(second));
    if firsts.len() * seconds.len() > MAX_PAIRS {
        return Vec::new();
    }
    let distance = first.distance(second);
    let mut turns = Vec::new();
    for &a in &firsts {
        for &b in &seconds {
            if (a.distance(b) - distance).abs() <= 2.0 * tolerance {
                turns.extend(rotation([first, second], [a, b]).and_then(turn));
            }
        }
    }
    turns
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

/// Axis and angle of a rotation; `None` below the turn of the highest order looked for.
fn turn(rotation: DQuat) -> Option<Turn> {
    let (axis, angle) = rotation.to_axis_angle();
    let angle = angle.min(2.0 * PI - angle);
    (angle > PI / f64::from(MAX_ORDER)).then_some(Turn { axis, angle })
}
