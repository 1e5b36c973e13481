//! Directions in which a symmetry axis may lie.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};

use super::axis::MAX_ORDER;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Pairs of far-out vertices compared at most; beyond, the part is round or has so many equal
/// corners that its principal axes have to do.
const MAX_PAIRS: usize = 1 << 16;

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
