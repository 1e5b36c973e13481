//! Repair: what it repairs, what it reports, what it refuses.

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand::rngs::SmallRng;
use rand::seq::SliceRandom;
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LengthUnit, MeshError, RepairOptions, RepairReport, TriangleMesh, shapes};

use crate::common::assert_close;
use crate::common::bare::{clean, faulty, joined, moved, raw, reversed, scaled, unit_cube};

#[test]
fn empty_meshes_are_refused() {
    assert!(matches!(
        clean(Vec::new(), Vec::new()),
        Err(MeshError::Empty {
            vertices: 0,
            triangles: 0,
            ..
        })
    ));
    let line = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
    let error = clean(line, vec![[0, 1, 2], [0, 0, 1]]).expect_err("no area");
    assert!(matches!(
        error,
        MeshError::Empty {
            vertices: 3,
            triangles: 2,
            zero_area: 2,
            ..
        }
    ));
    assert!(
        error
            .to_string()
            .starts_with("part: expected at least one triangle")
    );
}

#[test]
fn non_finite_vertices_are_refused_by_index() {
    let (vertices, triangles) = raw(&unit_cube());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e13] {
        let mut vertices = vertices.clone();
        vertices[5].y = bad;
        let error = clean(vertices, triangles.clone()).expect_err("not finite");
        assert!(
            matches!(error, MeshError::NonFiniteVertex { vertex: 5, .. }),
            "{error}"
        );
    }
}

#[test]
fn indices_out_of_range_are_refused_with_the_triangle() {
    let (vertices, mut triangles) = raw(&unit_cube());
    triangles[7][1] = 8;
    assert!(matches!(
        clean(vertices, triangles),
        Err(MeshError::IndexOutOfRange {
            triangle: 7,
            expected: 8,
            found: 8,
            ..
        })
    ));
}

#[test]
fn options_out_of_range_are_refused() {
    let (vertices, triangles) = raw(&unit_cube());
    for (weld_tolerance, max_open_fraction, name) in [
        (-1e-9, 0.1, "weld-tolerance"),
        (0.5, 0.1, "weld-tolerance"),
        (f64::NAN, 0.1, "weld-tolerance"),
        (1e-6, 1.5, "max-open-fraction"),
    ] {
        let options = RepairOptions {
            weld_tolerance,
            max_open_fraction,
        };
        let result = TriangleMesh::clean("part", vertices.clone(), triangles.clone(), &options);
        assert!(matches!(result, Err(MeshError::OutOfRange { item, .. }) if item == name));
    }
}

#[test]
fn an_open_mesh_is_warned_about_or_refused_by_its_missing_area() {
    let sphere = shapes::icosphere(1.0, 8).expect("valid size");
    let (vertices, triangles) = raw(&sphere);
    let area = sphere.area();
    // Every 100th face away: about 1 % of the area.
    let few: Vec<_> = triangles
        .iter()
        .enumerate()
        .filter(|(i, _)| i % 100 != 0)
        .map(|(_, t)| *t)
        .collect();
    let gone = triangles.len() - few.len();
    let (mesh, report) = clean(vertices.clone(), few).expect("1 % is accepted");
    assert_eq!(report.open_edges, 3 * gone);
    assert!(!report.watertight);
    // Single triangles are missing, so the fans have exactly their area.
    let missing = area - mesh.area();
    assert_close(report.open_area_fraction, missing / area, 1e-9);
    assert!(
        report
            .warnings()
            .iter()
            .any(|w| w.contains("39 open edges")),
        "{:?}",
        report.warnings()
    );

    let half: Vec<_> = triangles
        .iter()
        .copied()
        .filter(|t| t.iter().map(|&v| vertices[v as usize].z).sum::<f64>() < 1.5)
        .collect();
    let error = clean(vertices, half).expect_err("a large hole is refused");
    assert!(
        matches!(error, MeshError::Open { limit: 0.1, found, .. } if found > 0.1),
        "{error}"
    );
}

#[test]
fn a_box_without_its_lid_misses_a_sixth() {
    let (vertices, triangles) = raw(&unit_cube());
    let open: Vec<_> = triangles
        .into_iter()
        .filter(|t| t.iter().any(|&v| vertices[v as usize].z < 0.0))
        .collect();
    let error = clean(vertices.clone(), open.clone()).expect_err("a sixth is over a tenth");
    assert!(
        matches!(error, MeshError::Open { open_edges: 4, found, .. } if (found - 1.0 / 6.0).abs() < 1e-12)
    );
    let lenient = RepairOptions {
        max_open_fraction: 0.2,
        ..RepairOptions::default()
    };
    let inside_out = reversed(&open);
    let (_, report) = TriangleMesh::clean("part", vertices, inside_out, &lenient).expect("allowed");
    assert_eq!(
        report.flipped_faces, 10,
        "an open shell, too, is turned outwards"
    );
}

#[test]
fn an_inverted_mesh_is_turned_and_said() {
    let cube = unit_cube();
    let (vertices, triangles) = raw(&cube);
    let (mesh, report) = clean(vertices, reversed(&triangles)).expect("repairable");
    assert_eq!(report.flipped_faces, 12);
    assert!(mesh.volume() > 0.0);
    assert_eq!(
        report.warnings(),
        ["part: 12 faces pointed the wrong way: reversed"]
    );
}

#[test]
fn randomly_flipped_faces_are_made_consistent() {
    let sphere = shapes::icosphere(1.0, 6).expect("valid size");
    let (vertices, mut triangles) = raw(&sphere);
    let mut count = 0;
    for (i, t) in triangles.iter_mut().enumerate() {
        if i * 7919 % 13 < 5 {
            t.swap(1, 2);
            count += 1;
        }
    }
    let (mesh, report) = clean(vertices, triangles).expect("repairable");
    assert_eq!(report.flipped_faces, count);
    assert!(report.watertight);
    assert_close(mesh.volume(), sphere.volume(), 1e-12);
}

#[test]
fn duplicate_and_zero_area_faces_are_dropped_and_said() {
    let cube = unit_cube();
    let (vertices, mut triangles) = raw(&cube);
    let [a, b, c] = triangles[3];
    triangles.extend([[b, c, a], [a, b, c], [a, a, b]]);
    let (mesh, report) = clean(vertices, triangles).expect("repairable");
    assert_eq!((report.duplicate_faces, report.zero_area_faces), (2, 1));
    assert_eq!(mesh, cube);
    assert_eq!(report.warnings().len(), 2);
}

#[test]
fn a_triangle_soup_is_welded() {
    let torus = shapes::torus(0.03, 0.01, 24, 12).expect("valid size");
    let mut rng = SmallRng::seed_from_u64(3);
    let mut vertices = Vec::new();
    for corner in torus.faces().flatten() {
        // Jitter far below the tolerance of 1e-6 of the diagonal, 0.11 m.
        let jitter = DVec3::from_array(std::array::from_fn(|_| {
            rand::Rng::random_range(&mut rng, -1e-9..1e-9)
        }));
        vertices.push(corner + jitter);
    }
    let triangles = (0..vertices.len() as u32 / 3)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    let (mesh, report) = clean(vertices, triangles).expect("repairable");
    assert_eq!(report.vertices, torus.vertices().len());
    assert_eq!(
        report.welded_vertices,
        report.input_vertices - report.vertices
    );
    assert!(report.watertight);
    // Jitter of 1e-9 m on a tube of 1e-2 m.
    assert_close(mesh.volume(), torus.volume(), 1e-6);
}

#[test]
fn a_one_sided_surface_is_said() {
    // A Moebius strip of 12 quads.
    let n = 12;
    let mut vertices = Vec::new();
    for i in 0..n {
        let angle = 2.0 * std::f64::consts::PI * f64::from(i) / f64::from(n);
        let radial = DVec3::new(angle.cos(), angle.sin(), 0.0);
        let across = 0.3 * ((0.5 * angle).cos() * radial + (0.5 * angle).sin() * DVec3::Z);
        vertices.extend([radial - across, radial + across]);
    }
    let mut triangles = Vec::new();
    for i in 0..n as u32 {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i + 1 < n as u32 {
            (a + 2, b + 2)
        } else {
            (1, 0)
        };
        triangles.extend([[a, b, d], [a, d, c]]);
    }
    let options = RepairOptions {
        max_open_fraction: 1.0,
        ..RepairOptions::default()
    };
    let (_, report) = TriangleMesh::clean("strip", vertices, triangles, &options).expect("allowed");
    assert!(report.inconsistent_edges > 0);
    assert!(report.warnings().iter().any(|w| w.contains("one-sided")));
}

/// Faces as sorted sets of positions, each running from its lowest corner.
fn face_set(mesh: &TriangleMesh) -> Vec<[[u64; 3]; 3]> {
    let mut faces: Vec<_> = mesh
        .faces()
        .map(|f| {
            let ring = f.map(|p| p.to_array().map(f64::to_bits));
            let first = (0..3).min_by_key(|&i| ring[i]).unwrap_or(0);
            std::array::from_fn(|i| ring[(first + i) % 3])
        })
        .collect();
    faces.sort_unstable();
    faces
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn repair_is_idempotent(seed in any::<u64>()) {
        let (vertices, triangles) = faulty(seed);
        let (once, _) = clean(vertices, triangles).expect("repairable");
        let (twice, report) = clean(raw(&once).0, raw(&once).1).expect("clean");
        prop_assert_eq!(&once, &twice);
        prop_assert_eq!(report.flipped_faces + report.duplicate_faces + report.zero_area_faces, 0);
        prop_assert_eq!(report.welded_vertices, 0);
        prop_assert_eq!(once.hash(), twice.hash());
    }

    #[test]
    fn the_order_of_triangles_does_not_matter(seed in any::<u64>()) {
        let (vertices, triangles) = faulty(seed);
        let mut shuffled = triangles.clone();
        shuffled.shuffle(&mut SmallRng::seed_from_u64(!seed));
        let (a, report_a) = clean(vertices.clone(), triangles).expect("repairable");
        let (b, report_b) = clean(vertices, shuffled).expect("repairable");
        prop_assert_eq!(face_set(&a), face_set(&b));
        prop_assert_eq!(report_a.cavities, report_b.cavities);
    }

    #[test]
    fn rigid_motion_keeps_volume_area_and_report(
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in -3.0f64..3.0,
        offset in prop::array::uniform3(-100.0f64..100.0),
    ) {
        let (vertices, triangles) = faulty(1);
        let (mesh, report) = clean(vertices.clone(), triangles.clone()).expect("repairable");
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
        let (rotation, offset) = (DQuat::from_axis_angle(axis, angle), DVec3::from_array(offset));
        let elsewhere = vertices.iter().map(|&v| rotation * v + offset).collect();
        let (moved, moved_report) = clean(elsewhere, triangles).expect("repairable");
        prop_assert_eq!(moved_report.flipped_faces, report.flipped_faces);
        prop_assert_eq!(moved_report.cavities, report.cavities);
        // Coordinates near 100 hold 1e-14 of absolute rounding on a part of size 8.
        prop_assert!((moved.volume() / mesh.volume() - 1.0).abs() < 1e-11);
        prop_assert!((moved.area() / mesh.area() - 1.0).abs() < 1e-11);
        let carried = mesh.transformed(rotation, offset);
        prop_assert!((carried.volume() / mesh.volume() - 1.0).abs() < 1e-11);
        prop_assert!(carried.centroid().distance(rotation * mesh.centroid() + offset) < 1e-11);
        prop_assert_ne!(carried.hash(), mesh.hash());
    }

    #[test]
    fn any_soup_is_cleaned_or_refused(
        coordinates in prop::collection::vec(prop::array::uniform3(-2i8..=2), 1..12),
        faces in prop::collection::vec(prop::array::uniform3(0u32..12), 0..30),
    ) {
        let vertices: Vec<_> = coordinates.iter().map(|c| DVec3::from_array(c.map(f64::from))).collect();
        let options = RepairOptions { max_open_fraction: 1.0, ..RepairOptions::default() };
        if let Ok((mesh, report)) = TriangleMesh::clean("soup", vertices, faces, &options) {
            prop_assert!((0.0..=1.0).contains(&report.open_area_fraction));
            prop_assert!(!report.watertight || report.open_edges == 0);
            let (again, _) = TriangleMesh::clean("soup", raw(&mesh).0, raw(&mesh).1, &options)
                .expect("what repair made is accepted");
            prop_assert_eq!(mesh, again);
        }
    }
}

#[test]
fn neither_scale_nor_place_changes_what_is_found() {
    let (vertices, triangles) = faulty(5);
    let (_, here) = clean(vertices.clone(), triangles.clone()).expect("repairable");
    for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-6, 1.0)] {
        let elsewhere = vertices.iter().map(|v| scale * *v + offset).collect();
        let (mesh, report) = clean(elsewhere, triangles.clone()).expect("repairable");
        let counts = |r: &RepairReport| {
            [
                r.vertices,
                r.triangles,
                r.flipped_faces,
                r.components,
                r.cavities,
                r.open_edges,
            ]
        };
        assert_eq!(counts(&report), counts(&here));
        // At 1e6 sizes from the origin a coordinate holds 1e-10 of the size.
        let expected = here.volume * scale.powi(3);
        assert_close(mesh.volume(), expected, 1e-8);
    }
}

/// A unit cube whose top is a fan over `n` points per side and whose sides know only the corners.
fn cube_with_cracks(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = raw(&unit_cube());
    triangles.retain(|t| t.iter().any(|&v| vertices[v as usize].z < 0.0));
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
    let first = vertices.len() as u32;
    for k in 0..4 {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        for i in 0..n {
            let s = f64::from(i) / f64::from(n);
            vertices.push(DVec3::new(
                a.0 + s * (b.0 - a.0),
                a.1 + s * (b.1 - a.1),
                0.5,
            ));
        }
    }
    let center = vertices.len() as u32;
    vertices.push(DVec3::new(0.0, 0.0, 0.5));
    triangles.extend((0..4 * n).map(|i| [center, first + i, first + (i + 1) % (4 * n)]));
    (vertices, triangles)
}

#[test]
fn faces_that_meet_without_sharing_vertices_are_stitched() {
    for n in [2, 3, 8] {
        let (vertices, triangles) = cube_with_cracks(n);
        let (mesh, report) = clean(vertices, triangles).expect("repairable");
        assert_eq!(report.stitched_edges, 4);
        assert!(report.watertight);
        assert_eq!(report.triangles, 10 + 4 * (n as usize - 1) + 4 * n as usize);
        assert_close(mesh.volume(), 1.0, 1e-12);
        assert_close(mesh.area(), 6.0, 1e-12);
    }
}

#[test]
fn a_crack_that_is_not_stitched_has_no_area() {
    let options = RepairOptions {
        weld_tolerance: 0.0,
        ..RepairOptions::default()
    };
    let (mut vertices, triangles) = cube_with_cracks(4);
    // Off the line by more than nothing, but by no area to speak of.
    for v in vertices
        .iter_mut()
        .skip(8)
        .filter(|v| v.x.abs() < 0.5 || v.y.abs() < 0.5)
    {
        v.z += 1e-9;
    }
    let (_, report) =
        TriangleMesh::clean("cracks", vertices, triangles, &options).expect("no area is missing");
    assert_eq!(report.open_edges, 4 + 16);
    assert!(
        report.open_area_fraction < 1e-8,
        "{}",
        report.open_area_fraction
    );
}

#[test]
fn needles_without_area_leave_no_crack() {
    // The corners of a square, and a point in the middle of its diagonal that only one half uses.
    let (mut vertices, mut triangles) = raw(&unit_cube());
    let [a, b, c] = triangles[0];
    let longest = [[a, b, c], [b, c, a], [c, a, b]]
        .into_iter()
        .max_by(|s, t| {
            let length = |t: &[u32; 3]| vertices[t[0] as usize].distance(vertices[t[1] as usize]);
            length(s).total_cmp(&length(t))
        })
        .expect("three sides");
    let [a, b, c] = longest;
    let middle = vertices.len() as u32;
    vertices.push(0.5 * (vertices[a as usize] + vertices[b as usize]));
    triangles[0] = [a, middle, c];
    triangles.extend([[middle, b, c], [a, b, middle]]);
    let (mesh, report) = clean(vertices, triangles).expect("repairable");
    assert_eq!((report.zero_area_faces, report.stitched_edges), (1, 1));
    assert!(report.watertight);
    assert_close(mesh.volume(), 1.0, 1e-12);
}

#[test]
fn knots_hardly_larger_than_the_weld_distance_are_left_open() {
    // The far vertex makes the weld distance 1.3, the size of the other faces: each lies along
    // sides of others, and cutting those opened sides to cut without end. Found by fuzzing.
    let bytes = include_bytes!("data/knot.obj");
    let file = MeshFile::parse("knot", bytes, MeshFormat::Obj, None).expect("lines of an OBJ file");
    let mut options = ReadOptions {
        unit: LengthUnit::M,
        solid: Some("3".into()),
        // Some of its lines are no statements.
        lossy: true,
        ..ReadOptions::default()
    };
    options.repair.max_open_fraction = 1.0;
    let (_, report) = file.clean(&options).expect("any fraction may be open");
    assert_eq!(report.input_triangles, 4);
    assert!(report.triangles < 16, "{} faces", report.triangles);
    assert!(report.open_edges > 0);
}

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
