//! Hygiene: what it repairs, what it reports, what it refuses.

use crate::common::bare::{clean, raw, reversed, unit_cube};
use glam::DVec3;
use rand::SeedableRng;
use rand::rngs::SmallRng;
use sdf_grid::{MeshError, RepairOptions, TriangleMesh, shapes};

use crate::common::assert_close;

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
