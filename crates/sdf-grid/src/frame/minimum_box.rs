//! The frame in which the box around a part is smallest.

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec3};

use crate::frame::principal_axes::principal_axes;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Normals within about this of each other are one direction.
const SAME: f64 = 1e-3;

/// How many of the directions with the most area are tried.
const TRIED: usize = 3;

/// A box smaller by less than this is not worth another frame.
const WORTHWHILE: f64 = 0.95;

/// A rotation after which the box of `mesh` along the axes is small: the smallest of its own, those
/// along its largest flat faces and the one along its principal axes. The identity unless the box
/// becomes smaller by a twentieth at least.
pub fn minimum_box_rotation(mesh: &TriangleMesh) -> DQuat {
    let volume = |rotation: DQuat| {
        let corners = mesh.triangles().iter().flatten();
        let turned = corners.map(|v| rotation * mesh.vertices()[*v as usize]);
        Aabb::around(turned).size().element_product()
    };
    let directions = face_directions(mesh);
    let along_faces = directions.iter().take(TRIED).map(|first| {
        let across = |d: &&DVec3| d.dot(*first).abs() < SAME;
        let second = directions.iter().find(across);
        turn_onto_axes(*first, *second.unwrap_or(&first.any_orthonormal_vector()))
    });
    let [first, second, _] = principal_axes(mesh, mesh.centroid());
    let best = along_faces
        .chain([turn_onto_axes(first, second)])
        .map(|rotation| (rotation, volume(rotation)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    match best {
        Some((rotation, size)) if size < WORTHWHILE * volume(DQuat::IDENTITY) => rotation,
        _ => DQuat::IDENTITY,
    }
}

/// The directions of the faces, front or back, that with the most area first.
fn face_directions(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut areas: HashMap<[i32; 3], DVec3> = HashMap::new();
    for [a, b, c] in mesh.faces() {
        let vector = 0.5 * (b - a).cross(c - a);
        let Some(normal) = vector.try_normalize() else {
            continue;
        };
        let key = |n: DVec3| n.to_array().map(|c| (c / SAME).round() as i32);
        let (front, back) = (key(normal), key(-normal));
        let (key, vector) = if front > back {
            (front, vector)
        } else {
            (back, -vector)
        };
        *areas.entry(key).or_default() += vector;
    }
    let mut sums: Vec<_> = areas.into_iter().collect();
    // Equal areas in an order that does not depend on the map's.
    sums.sort_by(|(k, a), (l, b)| b.length().total_cmp(&a.length()).then(k.cmp(l)));
    let directions = sums.into_iter().filter_map(|s| s.1.try_normalize());
    directions.collect()
}

/// The rotation that turns two directions, made orthogonal, onto z and x.
fn turn_onto_axes(first: DVec3, second: DVec3) -> DQuat {
    let z = first.normalize();
    let x = second
        .reject_from(z)
        .try_normalize()
        .unwrap_or_else(|| z.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z).transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn turned_parts_fill_their_boxes_again() {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 0.4));
        let block = shapes::cuboid(DVec3::new(0.01, 0.02, 0.07)).unwrap();
        let peg = shapes::cylinder(0.004, 0.05, 90).unwrap();
        let star = shapes::random_solid(3).unwrap();
        for (mesh, allowed) in [(block, 1e-9), (peg, 1e-3), (star, 0.3)] {
            let before = mesh.bounds().size().element_product();
            let turned = mesh.transformed(turn, DVec3::splat(0.1));
            let rotation = minimum_box_rotation(&turned);
            assert!((rotation.length() - 1.0).abs() < 1e-12);
            let tight = turned.transformed(rotation, DVec3::ZERO).bounds();
            let after = tight.size().element_product();
            assert!(after <= (1.0 + allowed) * before, "{after} {before}");
        }
    }

    #[test]
    fn parts_that_fill_their_boxes_stay() {
        let block = shapes::cuboid(DVec3::new(0.01, 0.02, 0.07)).unwrap();
        assert_eq!(minimum_box_rotation(&block), DQuat::IDENTITY);
        for which in shapes::PegInHole::ALL {
            let (hole, peg) = which.pair(0.0).unwrap();
            assert_eq!(minimum_box_rotation(&hole), DQuat::IDENTITY);
            assert_eq!(minimum_box_rotation(&peg), DQuat::IDENTITY);
        }
    }
}
