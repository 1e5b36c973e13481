//! Whether two parts have the same shape, and the motion that carries one onto the other.
//!
//! Candidates are the rotations that carry far-out vertices onto others (parts cut into the same
//! triangles) and the principal axes onto each other (parts cut differently). One counts if it
//! carries samples of either surface to within a tolerance of the other.

use glam::{DMat3, DQuat, DVec3};

use crate::frame::matching::{SurfaceSamples, vertex_rotations};
use crate::frame::principal_axes::principal_moments;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// The motion that carries `part` onto `other`: a point `p` of `part` goes to `rotation * p +
/// translation`. None if they do not have the same shape; a mirror image does not.
///
/// They have if every sample of either surface comes to within `tolerance` (metres) of the other.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{congruence, shapes};
///
/// let brick = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03))?;
/// let moved = brick.transformed(DQuat::from_rotation_x(0.4), DVec3::Z);
/// let (rotation, translation) = congruence(&brick, &moved, 1e-6).unwrap();
/// assert!((rotation * brick.centroid() + translation).distance(moved.centroid()) < 1e-9);
/// assert!(congruence(&brick, &shapes::cuboid(DVec3::splat(0.02))?, 1e-6).is_none());
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
pub fn congruence(
    part: &TriangleMesh,
    other: &TriangleMesh,
    tolerance: f64,
) -> Option<(DQuat, DVec3)> {
    // A shell as thick as the tolerance may be all that differs.
    let volumes_differ = (part.volume() - other.volume()).abs() > tolerance * other.area();
    let [from, to] = [part, other].map(TriangleMesh::centroid);
    let [radius, other_radius] = [(part, from), (other, to)].map(|(m, c)| m.radius_about(c));
    if volumes_differ || (radius - other_radius).abs() > 2.0 * tolerance {
        return None;
    }
    let [samples, back] = [(part, from), (other, to)].map(|(m, c)| SurfaceSamples::new(m, c));
    let [own, bvh] = [part, other].map(Bvh::build);
    let carries = |rotation: &DQuat| {
        let near = |tree: &Bvh, p: DVec3| tree.nearest_within(p, tolerance).is_some();
        let there = |q: &DVec3| near(&bvh, to + *rotation * *q);
        let home = |q: &DVec3| near(&own, from + rotation.conjugate() * *q);
        samples.offsets.iter().all(there) && back.offsets.iter().all(home)
    };
    let mut candidates = axis_rotations((part, from), (other, to))
        .into_iter()
        .chain(vertex_rotations((part, from), (other, to), tolerance));
    let rotation = candidates.find(carries)?;
    Some((rotation, to - rotation * from))
}

/// The rotations that carry principal axes onto those of the same moments.
fn axis_rotations(from: (&TriangleMesh, DVec3), to: (&TriangleMesh, DVec3)) -> [DQuat; 4] {
    let [a, b] = [from, to].map(|(mesh, centre)| {
        let mut moments = principal_moments(mesh, centre);
        moments.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [(_, x), (_, y), _] = moments;
        (x, y)
    });
    let frame = |(x, y): (DVec3, DVec3)| DMat3::from_cols(x, y, x.cross(y));
    [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(sx, sy)| {
        let turned = frame((sx * b.0, sy * b.1));
        DQuat::from_mat3(&(turned * frame(a).transpose()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// Carried onto each other under a random motion, whatever their symmetry or tessellation;
    /// mirror images and other sizes are not.
    #[test]
    fn equal_shapes_are_found_and_others_are_not() {
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 2.1);
        let shift = DVec3::new(0.3, -0.2, 0.1);
        let hand = |side: f64| {
            let blocks = [
                (DVec3::ZERO, DVec3::new(0.03, 0.02, 0.01)),
                (DVec3::new(0.01, 0.005, 0.01), DVec3::splat(0.01)),
                (
                    DVec3::new(-0.01, -0.005 * side, 0.0075),
                    DVec3::splat(0.005),
                ),
            ];
            let moved = blocks.map(|(at, size)| {
                shapes::cuboid(size)
                    .unwrap()
                    .transformed(DQuat::IDENTITY, at)
            });
            TriangleMesh::joined(&moved)
        };
        let parts = [
            shapes::cuboid(DVec3::splat(0.02)).unwrap(),
            shapes::cuboid(DVec3::new(0.01, 0.01, 0.05)).unwrap(),
            shapes::cylinder(0.01, 0.03, 48).unwrap(),
            shapes::icosphere(0.01, 2).unwrap(),
            hand(1.0),
        ];
        for (i, part) in parts.iter().enumerate() {
            for (k, other) in parts.iter().enumerate() {
                let moved = other.transformed(turn, shift);
                let found = congruence(part, &moved, 1e-6);
                assert_eq!(found.is_some(), i == k, "{i} {k}");
                if let Some((rotation, translation)) = found {
                    let bvh = Bvh::build(&moved);
                    for v in part.vertices() {
                        assert!(bvh.nearest(rotation * *v + translation).distance < 1e-6);
                    }
                }
            }
        }
        assert!(congruence(&hand(1.0), &hand(-1.0), 1e-4).is_none());
        assert!(
            congruence(
                &parts[2],
                &shapes::cylinder(0.01, 0.0302, 48).unwrap(),
                1e-5
            )
            .is_none()
        );
        // Cut differently.
        let other = shapes::cylinder(0.01, 0.03, 80)
            .unwrap()
            .transformed(turn, shift);
        assert!(congruence(&parts[2], &other, 5e-5).is_some());
    }
}
