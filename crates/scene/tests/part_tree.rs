//! Trees of parts as URDF, MJCF and GLB: joints, names, places.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::PathBuf;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, JointKind, Travel};
use glam::{DQuat, DVec3};
use pegfit_scene::{
    ExportError, GlbPart, JointedPart, PartTree, SolidOptions, SolidSet, write_glb,
    write_tree_mjcf, write_tree_urdf,
};
use sdf_grid::TriangleMesh;
use sdf_grid::shapes::cuboid;

fn pose(axis: DVec3, angle: f64, shift: [f64; 3]) -> Pose {
    Pose::new(
        DQuat::from_axis_angle(axis, angle),
        DVec3::from_array(shift),
    )
}

fn joint(kind: JointKind, axis: DVec3, point: [f64; 3]) -> Joint {
    let screw = kind == JointKind::Screw;
    let turns = screw || kind != JointKind::Fixed;
    let travel = |range| Travel {
        range,
        blocked: [true; 2],
    };
    Joint {
        kind,
        axis,
        point: DVec3::from_array(point),
        pitch: if screw { 0.002 } else { 0.0 },
        slide: (kind == JointKind::Cylindrical).then(|| travel([-0.01, 0.02])),
        turn: turns.then(|| travel([-0.5, 0.75])),
        free: Vec::new(),
    }
}

/// A base, an arm that turns on it, a rod that slides and turns in the arm, two screws of one name in
/// the base, and a part that hangs from the rod with a pose that contact does not determine.
fn tree(meshes: &[TriangleMesh]) -> PartTree<'_> {
    let none = JointKind::Fixed;
    let parts: [(&str, Option<usize>, Pose, JointKind); 6] = [
        ("base", None, pose(DVec3::X, 0.3, [1.0, -0.5, 0.25]), none),
        (
            "arm <1>",
            Some(0),
            pose(DVec3::Y, FRAC_PI_2, [0.0, 0.02, 0.05]),
            JointKind::Revolute,
        ),
        (
            "rod",
            Some(1),
            pose(DVec3::Z, -1.0, [0.04, 0.0, 0.01]),
            JointKind::Cylindrical,
        ),
        (
            "screw",
            Some(0),
            pose(DVec3::X, 0.0, [0.01, 0.01, 0.03]),
            JointKind::Screw,
        ),
        (
            "screw",
            Some(0),
            pose(DVec3::X, 2.0, [-0.01, 0.01, 0.03]),
            JointKind::Screw,
        ),
        (
            "loose",
            Some(2),
            pose(DVec3::Z, 0.7, [0.0, 0.01, 0.02]),
            JointKind::Undetermined(4),
        ),
    ];
    let jointed = parts
        .into_iter()
        .zip(meshes)
        .map(|((name, parent, pose, kind), mesh)| JointedPart {
            name: name.to_owned(),
            mesh,
            parent,
            pose,
            joint: joint(kind, DVec3::new(1.0, 2.0, -2.0) / 3.0, [0.01, 0.02, 0.03]),
        });
    PartTree {
        name: "whole",
        parts: jointed.collect(),
        kept: Vec::new(),
    }
}

fn meshes() -> Vec<TriangleMesh> {
    let size = |i: usize| DVec3::new(0.01, 0.02, 0.03) * (1.0 + 0.1 * i as f64);
    (0..6).map(|i| cuboid(size(i)).unwrap()).collect()
}

/// Where the parts of a tree lie in the scene.
fn places(tree: &PartTree) -> Vec<Pose> {
    let mut at: Vec<Pose> = Vec::new();
    for part in &tree.parts {
        at.push(part.parent.map_or(part.pose, |p| at[p] * part.pose));
    }
    at
}

/// Checks that each part's surface lies in a file where it does in the tree.
fn expect_places(file: PathBuf, tree: &PartTree, names: &[&str], tolerance: f64) {
    let set = SolidSet::read(&file, &SolidOptions::default()).unwrap();
    assert_eq!(set.solids.len(), tree.parts.len());
    for ((part, at), name) in tree.parts.iter().zip(places(tree)).zip(names) {
        let solid = set.solids.iter().find(|s| s.name == *name);
        let found = solid.unwrap_or_else(|| panic!("no {name}")).placed();
        let expected = part.mesh.transformed(at.rotation, at.translation);
        assert_eq!(found.vertices().len(), expected.vertices().len());
        // Readers may order vertices anew.
        for p in found.vertices() {
            let nearest = expected.vertices().iter().map(|q| p.distance(*q));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            assert!(nearest < tolerance, "{name}: {nearest}");
        }
    }
}

const NAMES: [&str; 6] = ["base", "arm <1>", "rod", "screw", "screw 2", "loose"];

#[test]
fn a_tree_as_urdf_has_its_joints_and_reads_back_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, file) = (meshes(), folder.path().join("out.urdf"));
    let tree = tree(&meshes);
    write_tree_urdf(&tree, &file).unwrap();
    expect_places(file.clone(), &tree, &NAMES, 1e-12);
    let text = std::fs::read_to_string(&file).unwrap();
    let count = |what: &str| text.matches(what).count();
    assert_eq!(count("type=\"fixed\""), 1);
    // The arm, the turn of the rod, the turns of the screws.
    assert_eq!(count("type=\"revolute\""), 4);
    assert_eq!(count("type=\"prismatic\""), 3);
    assert_eq!(count("type=\"floating\""), 1);
    for name in ["whole-root", "rod-between-1", "screw 2-between-1"] {
        assert_eq!(count(&format!("<link name=\"{name}\"")), 1, "{name}");
    }
    assert_eq!(count("<mimic joint=\"screw 2-turn\""), 1);
    for mesh in ["base", "arm__1_", "screw", "screw-2"] {
        assert!(
            folder.path().join(format!("out-{mesh}.obj")).exists(),
            "{mesh}"
        );
    }
}

#[test]
fn a_tree_as_mjcf_nests_bodies_and_lets_free_ones_be() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, file) = (meshes(), folder.path().join("out.xml"));
    let tree = tree(&meshes);
    write_tree_mjcf(&tree, &file).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    let count = |what: &str| text.matches(what).count();
    assert_eq!(count("<body "), 6);
    // Only the base and the free part are the world's.
    assert_eq!(count("\n    <body "), 2, "{text}");
    assert_eq!(count("<freejoint name=\"loose-free\""), 1);
    // The arm, the rod, and both screws; what ties these.
    assert_eq!((count("type=\"hinge\""), count("type=\"slide\"")), (4, 3));
    assert_eq!((count("<fixed name="), count("<tendon tendon1=")), (2, 2));
    assert_eq!((count("<tendon>"), count("<equality>")), (1, 1));
    // They collide with other things, not with each other.
    assert_eq!(count("contype=\"2\" conaffinity=\"1\""), 6);
    assert_eq!(count("<exclude"), 0);
    // A screw of pitch p advances by p in a turn.
    let coefficient = format!("coef=\"{:?}\"", -0.002 / TAU);
    assert_eq!(count(&coefficient), 2, "{coefficient}");
}

#[test]
fn a_glb_has_every_part_in_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, file) = (meshes(), folder.path().join("out.glb"));
    let tree = tree(&meshes);
    let names = ["a", "b", "c", "d", "e", "f"];
    let parts: Vec<GlbPart> = (tree.parts.iter().zip(places(&tree)).zip(names))
        .map(|((part, pose), name)| GlbPart {
            name,
            mesh: part.mesh,
            pose,
        })
        .collect();
    write_glb(&parts, &file).unwrap();
    // Single precision.
    expect_places(file, &tree, &names, 1e-6);
}

#[test]
fn meshes_that_are_read_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("out-rod.obj");
    std::fs::write(&kept, "mine").unwrap();
    let meshes = meshes();
    let tree = PartTree {
        kept: vec![kept.clone()],
        ..tree(&meshes)
    };
    for written in [
        write_tree_urdf(&tree, &folder.path().join("out.urdf")),
        write_tree_mjcf(&tree, &folder.path().join("out.xml")),
    ] {
        assert!(
            matches!(written, Err(ExportError::Replaces { .. })),
            "{written:?}"
        );
    }
    assert_eq!(std::fs::read_to_string(kept).unwrap(), "mine");
}
