//! Symmetry axes of shapes whose symmetry is known.

use glam::{DQuat, DVec2, DVec3};
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::symmetry::detect;
use sdf_grid::{RepairOptions, SymmetryAxis, SymmetryOrder, TriangleMesh};

use SymmetryOrder::{Continuous, Finite};

/// 1e-3 of a part's radius: above the chord error of 96 segments, below any feature.
fn find(mesh: &TriangleMesh) -> Vec<SymmetryAxis> {
    detect(mesh, 1e-3 * mesh.radius_about(mesh.centroid()))
}

fn orders(axes: &[SymmetryAxis]) -> Vec<SymmetryOrder> {
    axes.iter().map(|a| a.order).collect()
}

fn along(axes: &[SymmetryAxis], direction: DVec3) -> Option<SymmetryOrder> {
    axes.iter()
        .find(|a| a.direction.cross(direction).length() < 1e-3)
        .map(|a| a.order)
}

#[test]
fn a_box_has_three_twofold_axes() {
    let mesh = shapes::cuboid(DVec3::new(0.02, 0.03, 0.05)).expect("valid size");
    let axes = find(&mesh);
    assert_eq!(orders(&axes), [Finite(2); 3]);
    for d in DVec3::AXES {
        assert_eq!(along(&axes, d), Some(Finite(2)));
    }
}

#[test]
fn a_cube_has_thirteen_axes() {
    let axes = find(&shapes::cuboid(DVec3::splat(0.02)).expect("valid size"));
    let expected = [vec![Finite(4); 3], vec![Finite(3); 4], vec![Finite(2); 6]].concat();
    assert_eq!(orders(&axes), expected);
    assert_eq!(along(&axes, DVec3::Y), Some(Finite(4)));
    assert_eq!(along(&axes, DVec3::ONE.normalize()), Some(Finite(3)));
}

#[test]
fn an_icosahedron_has_thirty_one_axes() {
    let axes = find(&shapes::icosphere(1.0, 1).expect("valid size"));
    let expected = [vec![Finite(5); 6], vec![Finite(3); 10], vec![Finite(2); 15]].concat();
    assert_eq!(orders(&axes), expected);
}

#[test]
fn prisms_have_the_order_of_their_polygon_and_turn_over() {
    for n in [3, 5, 6, 12] {
        let axes = find(&shapes::cylinder(0.01, 0.03, n).expect("valid size"));
        assert_eq!(along(&axes, DVec3::Z), Some(Finite(n)));
        assert_eq!(axes.len(), 1 + n as usize);
        assert!(
            axes[1..]
                .iter()
                .all(|a| a.order == Finite(2) && a.direction.z.abs() < 1e-9)
        );
    }
}

#[test]
fn a_cylinder_is_continuous_above_its_chord_error_and_finite_below() {
    let mesh = shapes::cylinder(0.01, 0.03, 96).expect("valid size");
    let chord = 0.01 * (1.0 - (std::f64::consts::PI / 96.0).cos());
    let coarse = detect(&mesh, 1.1 * chord);
    assert_eq!(orders(&coarse), [Continuous, Finite(2)]);
    assert!(coarse[0].direction.distance(DVec3::Z) < 1e-9);
    let fine = detect(&mesh, 0.1 * chord);
    assert_eq!(along(&fine, DVec3::Z), Some(Finite(96)));
}

#[test]
fn the_papers_pegs_have_the_symmetries_it_names() {
    for (pair, order) in [
        (PegInHole::Circular, Some(Continuous)),
        (PegInHole::Rectangular, Some(Finite(4))),
        (PegInHole::Combined, None),
    ] {
        let (hole, peg) = pair.pair(0.0).expect("valid clearance");
        assert_eq!(along(&find(&peg), DVec3::Z), order, "{} peg", pair.name());
        // The block is square, so that its hole is round only four times a turn.
        let hole_order = order.map(|_| Finite(4));
        assert_eq!(
            along(&find(&hole), DVec3::Z),
            hole_order,
            "{} hole",
            pair.name()
        );
    }
    // Mirrored in y, the combined peg still turns over about x.
    let (_, peg) = PegInHole::Combined.pair(0.0).expect("valid clearance");
    let axes = find(&peg);
    assert_eq!(orders(&axes), [Finite(2)]);
    assert_eq!(along(&axes, DVec3::X), Some(Finite(2)));
}

#[test]
fn spheres_and_tori_are_round() {
    let sphere = shapes::icosphere(1.0, 24).expect("valid size");
    assert_eq!(orders(&find(&sphere)), [Continuous; 3]);
    let torus = shapes::torus(0.03, 0.01, 128, 48).expect("valid size");
    assert_eq!(orders(&find(&torus)), [Continuous, Finite(2)]);
}

#[test]
fn a_part_without_symmetry_has_no_axis() {
    let outline = [
        (0.0, 0.0),
        (3.0, 0.0),
        (3.0, 1.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (0.0, 2.0),
    ];
    let mut mesh = shapes::prism(&outline.map(DVec2::from), &[], 1.0).expect("an L");
    // An L turns over about no axis of its own; a dent in z takes its mirror plane, too.
    let vertices = mesh
        .vertices()
        .iter()
        .map(|&v| {
            if v.z > 0.0 {
                v + 0.2 * v.x * DVec3::Z
            } else {
                v
            }
        })
        .collect();
    mesh = TriangleMesh::clean(
        "l",
        vertices,
        mesh.triangles().to_vec(),
        &RepairOptions::default(),
    )
    .expect("clean")
    .0;
    assert_eq!(find(&mesh), []);
}

#[test]
fn axes_turn_with_the_part() {
    let mesh = shapes::cuboid(DVec3::new(0.02, 0.02, 0.05)).expect("valid size");
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let offset = DVec3::new(3.0, -2.0, 0.5);
    let axes = find(&mesh.transformed(turn, offset));
    assert_eq!(
        orders(&axes),
        [vec![Finite(4)], vec![Finite(2); 4]].concat()
    );
    assert_eq!(along(&axes, turn * DVec3::Z), Some(Finite(4)));
    assert!(axes.iter().all(|a| a.point.distance(offset) < 1e-12));
}

#[test]
fn an_unevenly_cut_face_changes_nothing() {
    // A corner point of the top face's fan, off its centre.
    let cube = shapes::cuboid(DVec3::new(0.02, 0.02, 0.05)).expect("valid size");
    let (mut vertices, mut triangles) = (cube.vertices().to_vec(), cube.triangles().to_vec());
    let top = triangles
        .iter()
        .position(|t| t.iter().all(|&v| vertices[v as usize].z > 0.0))
        .expect("a top");
    let [a, b, c] = triangles[top];
    let extra = vertices.len() as u32;
    vertices.push(
        [a, b, c]
            .iter()
            .map(|&v| vertices[v as usize])
            .sum::<DVec3>()
            / 3.0,
    );
    triangles[top] = [a, b, extra];
    triangles.extend([[b, c, extra], [c, a, extra]]);
    let (mesh, _) =
        TriangleMesh::clean("cube", vertices, triangles, &RepairOptions::default()).expect("clean");
    assert_eq!(along(&find(&mesh), DVec3::Z), Some(Finite(4)));
}
