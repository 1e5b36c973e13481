//! Several shells in one mesh: nested, touching, doubled, cutting through each other.

use crate::common::bare::{clean, joined, moved, raw, reversed, scaled, unit_cube};
use glam::{DQuat, DVec3};
use sdf_grid::shapes;

use crate::common::assert_close;

#[test]
fn a_cavity_points_inwards_and_a_body_in_it_outwards() {
    let cube = unit_cube();
    let shells = [scaled(&cube, 4.0), scaled(&cube, 2.0), cube];
    let (vertices, triangles) = joined(&[&shells[0], &shells[1], &shells[2]]);
    let (mesh, report) = clean(vertices, triangles).expect("nested shells");
    assert_eq!(
        (report.components, report.cavities, report.flipped_faces),
        (3, 1, 12)
    );
    assert_close(mesh.volume(), 64.0 - 8.0 + 1.0, 1e-12);
    let (_, again) = clean(raw(&mesh).0, raw(&mesh).1).expect("still nested");
    assert_eq!(again.flipped_faces, 0);
}

#[test]
fn touching_shells_are_not_nested() {
    let cube = unit_cube();
    // Faces touch over a part of their area, so that no vertices weld.
    let small = moved(&scaled(&cube, 0.5), DVec3::new(0.75, 0.1, 0.05));
    let (vertices, triangles) = joined(&[&cube, &small]);
    let (mesh, report) = clean(vertices, triangles).expect("two bodies");
    assert_eq!((report.cavities, report.overlapping_components), (0, 0));
    assert_close(mesh.volume(), 1.125, 1e-12);
    // The same from inside: a cavity that reaches a wall.
    let niche = moved(&scaled(&cube, 0.5), DVec3::new(0.25, 0.1, 0.05));
    let (vertices, triangles) = joined(&[&cube, &niche]);
    let (mesh, report) = clean(vertices, triangles).expect("a body with a cavity");
    assert_eq!((report.cavities, report.overlapping_components), (1, 0));
    assert_close(mesh.volume(), 0.875, 1e-12);
}

#[test]
fn a_doubled_shell_stays_outward_and_is_said() {
    let sphere = shapes::icosphere(1.0, 4).expect("valid size");
    let turned = sphere.transformed(DQuat::from_rotation_x(0.2), DVec3::ZERO);
    let (vertices, triangles) = joined(&[&sphere, &turned]);
    let (mesh, report) = clean(vertices, triangles).expect("a doubled shell");
    assert_eq!((report.cavities, report.overlapping_components), (0, 2));
    assert_close(mesh.volume(), 2.0 * sphere.volume(), 1e-12);
    // Shell for shell the same faces: one of each is left.
    let (vertices, triangles) = joined(&[&sphere, &sphere]);
    let (mesh, report) = clean(vertices, triangles).expect("a doubled shell");
    assert_eq!(mesh, sphere);
    assert_eq!(report.duplicate_faces, sphere.triangles().len());
}

#[test]
fn bodies_that_cut_through_each_other_stay_outward_and_are_said() {
    let cube = unit_cube();
    let (vertices, triangles) = joined(&[&cube, &moved(&cube, DVec3::new(0.31, 0.47, 0.23))]);
    let (mesh, report) = clean(vertices, triangles).expect("two bodies");
    assert_eq!((report.cavities, report.overlapping_components), (0, 2));
    assert_close(mesh.volume(), 2.0, 1e-12);
}

#[test]
fn the_wall_between_solids_that_touch_is_dropped() {
    let cube = unit_cube();
    // Mirrored, so that the faces that touch are cut along the same diagonal.
    let vertices = cube
        .vertices()
        .iter()
        .map(|v| DVec3::new(1.0 - v.x, v.y, v.z))
        .collect();
    let (mirrored, _) = clean(vertices, cube.triangles().to_vec()).expect("a cube");
    let (vertices, triangles) = joined(&[&cube, &mirrored]);
    let (mesh, report) = clean(vertices, triangles).expect("two cubes");
    assert_eq!((report.duplicate_faces, report.components), (4, 1));
    assert!(report.watertight);
    assert_close(mesh.volume(), 2.0, 1e-12);
    assert_close(mesh.area(), 10.0, 1e-12);
}

#[test]
fn a_surface_listed_for_both_its_sides_is_kept_once() {
    let sphere = shapes::icosphere(1.0, 3).expect("valid size");
    let (vertices, triangles) = raw(&sphere);
    let both = [triangles.clone(), reversed(&triangles)].concat();
    let (mesh, report) = clean(vertices.clone(), both).expect("repairable");
    assert_eq!(mesh, sphere);
    assert_eq!(report.duplicate_faces, triangles.len());
    // The same with only some of the faces listed twice.
    let some = [triangles.clone(), reversed(&triangles[10..30])].concat();
    let (mesh, report) = clean(vertices, some).expect("repairable");
    assert_eq!(mesh, sphere);
    assert_eq!(report.duplicate_faces, 20);
}
