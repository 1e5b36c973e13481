//! Faces that meet along a line without sharing its vertices.

use crate::common::bare::{clean, raw, unit_cube};
use glam::DVec3;
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LengthUnit, RepairOptions, TriangleMesh};

use crate::common::assert_close;

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
