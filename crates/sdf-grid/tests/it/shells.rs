//! Several shells in one mesh: nested, touching, doubled, cutting through each other.

use crate::common::bare::{clean, joined, moved, raw, reversed, scaled, unit_cube};
use glam::{DQuat, DVec3};
use sdf_grid::{MeshError, RepairOptions, TriangleMesh, shapes};

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
    // Faces touch over a part of their area, so that no vertices weld: no wall is left between.
    let small = moved(&scaled(&cube, 0.5), DVec3::new(0.75, 0.1, 0.05));
    let (vertices, triangles) = joined(&[&cube, &small]);
    let (mesh, report) = clean(vertices, triangles).expect("two bodies");
    let found = (report.cavities, report.united_components, report.components);
    assert_eq!(found, (0, 2, 1));
    assert_close(mesh.volume(), 1.125, 1e-12);
    assert_close(mesh.area(), 6.0 + 1.5 - 2.0 * 0.25, 1e-12);
    // The same from inside: a cavity that reaches a wall.
    let niche = moved(&scaled(&cube, 0.5), DVec3::new(0.25, 0.1, 0.05));
    let (vertices, triangles) = joined(&[&cube, &niche]);
    let (mesh, report) = clean(vertices, triangles).expect("a body with a cavity");
    assert_eq!((report.cavities, report.united_components), (1, 0));
    assert_close(mesh.volume(), 0.875, 1e-12);
}

#[test]
fn a_doubled_shell_becomes_the_surface_of_the_union() {
    let sphere = shapes::icosphere(1.0, 4).expect("valid size");
    let turned = sphere.transformed(DQuat::from_rotation_x(0.2), DVec3::ZERO);
    let (vertices, triangles) = joined(&[&sphere, &turned]);
    let (mesh, report) = clean(vertices, triangles).expect("a doubled shell");
    let found = (report.cavities, report.united_components, report.components);
    assert_eq!(found, (0, 2, 1));
    assert!(report.watertight);
    // Both lie in the ball, whose volume the facets miss by half a percent at most.
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((sphere.volume()..ball).contains(&mesh.volume()));
    // Shell for shell the same faces: one of each is left.
    let (vertices, triangles) = joined(&[&sphere, &sphere]);
    let (mesh, report) = clean(vertices, triangles).expect("a doubled shell");
    assert_eq!(mesh, sphere);
    assert_eq!(report.duplicate_faces, sphere.triangles().len());
}

#[test]
fn bodies_that_cut_through_each_other_become_the_surface_of_the_union() {
    let cube = unit_cube();
    let (vertices, triangles) = joined(&[&cube, &moved(&cube, DVec3::new(0.31, 0.47, 0.23))]);
    let (mesh, report) = clean(vertices, triangles).expect("two bodies");
    let found = (report.cavities, report.united_components, report.components);
    assert_eq!(found, (0, 2, 1));
    assert_close(mesh.volume(), 2.0 - 0.69 * 0.53 * 0.77, 1e-9);
    let (_, again) = clean(raw(&mesh).0, raw(&mesh).1).expect("one body");
    assert_eq!(again.united_components, 0);
}

/// A solid and what is left of it after it was made of overlapping pieces, in a frame that nothing is
/// parallel to: one piece twice ten micrometres apart, a row of five, a pin that pokes out of a block
/// by a thousandth, and a hollow body through whose wall a bar goes.
#[test]
fn overlapping_shells_fill_what_their_union_fills_in_any_frame() {
    let cube = unit_cube();
    let block = |lo: [f64; 3], hi: [f64; 3]| {
        let (lo, hi) = (DVec3::from(lo), DVec3::from(hi));
        let middle = cube.bounds().center();
        let vertices = cube.vertices().iter();
        let vertices = vertices.map(|v| 0.5 * (lo + hi) + (v - middle) * (hi - lo));
        let vertices = vertices.collect();
        clean(vertices, cube.triangles().to_vec())
            .expect("a block")
            .0
    };
    let row = |k: usize| block([0.4 * k as f64, 0.0, 0.0], [0.4 * k as f64 + 0.5, 1.0, 1.0]);
    let cases: [(Vec<TriangleMesh>, f64); 4] = [
        (
            vec![
                block([0.0; 3], [1.0; 3]),
                block([1e-5, 0.0, 0.0], [1.0 + 1e-5, 1.0, 1.0]),
            ],
            1.0 + 1e-5,
        ),
        ((0..5).map(row).collect(), 2.1),
        (
            vec![
                block([0.0; 3], [1.0; 3]),
                block([0.45, 0.45, 0.1], [0.55, 0.55, 1.001]),
            ],
            1.0 + 0.01 * 0.001,
        ),
        (
            vec![
                block([0.0; 3], [1.0; 3]),
                block([0.2; 3], [0.8; 3]),
                block([0.1, 0.4, 0.4], [0.5, 0.6, 0.6]),
            ],
            1.0 - 0.6f64.powi(3) + 0.3 * 0.04,
        ),
    ];
    for (pieces, volume) in cases {
        for turn in [
            DQuat::IDENTITY,
            DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7)),
        ] {
            let turned: Vec<_> = (pieces.iter())
                .map(|p| p.transformed(turn, DVec3::new(3.0, -2.0, 1.0)))
                .collect();
            let (vertices, triangles) = joined(&turned.iter().collect::<Vec<_>>());
            let (mesh, report) = clean(vertices, triangles).expect("overlapping pieces");
            assert!(report.united_components >= 2, "{report:?}");
            assert!(report.watertight, "{report:?}");
            assert_close(mesh.volume(), volume, 1e-8);
        }
    }
}

#[test]
fn open_shells_that_cut_through_each_other_are_refused_by_name() {
    let cube = unit_cube();
    let (vertices, mut triangles) = joined(&[&cube, &moved(&cube, DVec3::new(0.31, 0.47, 0.23))]);
    triangles.pop();
    let options = RepairOptions::default();
    let refused = TriangleMesh::clean("two", vertices, triangles, &options).unwrap_err();
    let MeshError::Overlap { shells, .. } = &refused else {
        panic!("{refused}");
    };
    assert!(shells.contains(&1) && shells.contains(&2), "{refused}");
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
