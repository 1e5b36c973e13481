//! Docked pairs with their joints as URDF, MJCF and mates: names, numbers, limits, places.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, JointKind, MatingContact, Travel};
use glam::{DQuat, DVec3};
use pegfit_scene::{
    DockedPair, ExportError, MateKind, SolidOptions, SolidSet, mates, write_mates, write_mjcf,
    write_urdf,
};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use sdf_grid::shapes::{PegInHole, cuboid};
use sdf_grid::{SurfaceFeatures, TriangleMesh, mesh_io};

/// Every kind of joint, about an axis that is none of a frame's.
fn joint(kind: JointKind) -> Joint {
    let travel = |range, blocked| Some(Travel { range, blocked });
    let slides = matches!(kind, JointKind::Prismatic | JointKind::Cylindrical);
    let turns = !matches!(kind, JointKind::Fixed | JointKind::Prismatic);
    let has_axis = !matches!(
        kind,
        JointKind::Fixed | JointKind::Ball | JointKind::Undetermined(_)
    );
    let screw = kind == JointKind::Screw;
    let turn = if screw { [-TAU, 2.0 * TAU] } else { [-PI, PI] };
    Joint {
        kind,
        axis: if has_axis {
            DVec3::new(1.0, 2.0, -2.0) / 3.0
        } else {
            DVec3::ZERO
        },
        point: DVec3::new(0.01, 0.02, 0.03),
        pitch: if screw { -0.002 } else { 0.0 },
        slide: slides
            .then(|| travel([-0.004, 0.03], [true, false]))
            .flatten(),
        turn: turns.then(|| travel(turn, [false; 2])).flatten(),
        free: Vec::new(),
    }
}

const KINDS: [JointKind; 8] = [
    JointKind::Fixed,
    JointKind::Prismatic,
    JointKind::Revolute,
    JointKind::Cylindrical,
    JointKind::Screw,
    JointKind::Planar,
    JointKind::Ball,
    JointKind::Undetermined(4),
];

fn parts() -> (TriangleMesh, TriangleMesh) {
    let fixed = cuboid(DVec3::new(0.04, 0.05, 0.06)).unwrap();
    let moving = cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
    (fixed, moving)
}

fn pair<'a>((fixed, moving): &'a (TriangleMesh, TriangleMesh), joint: &'a Joint) -> DockedPair<'a> {
    DockedPair {
        name: "a <pair>",
        fixed,
        moving,
        placed: Pose::new(
            DQuat::from_scaled_axis(DVec3::new(0.3, 0.5, -1.0)),
            DVec3::new(1.0, -0.5, 0.25),
        ),
        pose: Pose::new(
            DQuat::from_axis_angle(DVec3::Y, FRAC_PI_2),
            DVec3::new(-0.02, 0.01, 0.04),
        ),
        joint,
        clearance: None,
        kept: Vec::new(),
    }
}

/// Names of the elements of a file with their attributes; panics if it is no XML.
fn elements(path: &Path) -> Vec<(String, Vec<(String, String)>)> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut reader = Reader::from_str(&text);
    let mut found = Vec::new();
    let read = |e: &BytesStart| {
        let attributes = e.attributes().map(|a| {
            let a = a.unwrap();
            let value = a
                .normalized_value(quick_xml::XmlVersion::default())
                .unwrap()
                .into_owned();
            (a.key.as_ref().to_owned(), value)
        });
        (e.name().as_ref().to_owned(), attributes.collect())
    };
    loop {
        match reader.read_event().unwrap() {
            Event::Start(e) | Event::Empty(e) => found.push(read(&e)),
            Event::Eof => return found,
            _ => {}
        }
    }
}

/// Values of an attribute of all elements of a name.
fn values(path: &Path, element: &str, key: &str) -> Vec<String> {
    elements(path)
        .into_iter()
        .filter(|(name, _)| name == element)
        .filter_map(|(_, a)| a.into_iter().find(|(k, _)| k == key).map(|(_, v)| v))
        .collect()
}

#[test]
fn a_urdf_has_the_joints_of_every_kind_and_reads_back_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.urdf");
    let expected: [&[&str]; 8] = [
        &["fixed"],
        &["prismatic"],
        &["continuous"],
        &["prismatic", "continuous"],
        &["revolute", "prismatic"],
        &["planar"],
        &["continuous"; 3],
        &["floating"],
    ];
    let meshes = parts();
    for (kind, expected) in KINDS.into_iter().zip(expected) {
        let joint = joint(kind);
        let pair = pair(&meshes, &joint);
        write_urdf(&pair, &path).unwrap();
        // The first one puts the fixed part into the scene.
        assert_eq!(values(&path, "joint", "type")[1..], *expected, "{kind:?}");
        let set = SolidSet::read(&path, &SolidOptions::default()).unwrap();
        let at = pair.placed * pair.pose;
        let places = [(&meshes.0, pair.placed), (&meshes.1, at)];
        assert_eq!(set.solids.len(), 2);
        for (solid, (mesh, at)) in set.solids.iter().zip(places) {
            let expected = mesh.transformed(at.rotation, at.translation);
            let found = solid.placed();
            for (p, q) in found.vertices().iter().zip(expected.vertices()) {
                assert!(p.distance(*q) < 1e-12, "{kind:?}: {p} {q}");
            }
        }
    }
}

#[test]
fn a_urdf_has_limits_a_mimic_and_masses() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.urdf");
    let meshes = parts();
    let screw = joint(JointKind::Screw);
    write_urdf(&pair(&meshes, &screw), &path).unwrap();
    let numbers = |element: &str, key: &str| -> Vec<f64> {
        let found = values(&path, element, key);
        found.iter().map(|v| v.parse().unwrap()).collect()
    };
    assert_eq!(numbers("limit", "lower"), [-TAU, -0.004]);
    assert_eq!(numbers("limit", "upper"), [2.0 * TAU, 0.002]);
    assert_eq!(numbers("mimic", "multiplier"), [-0.002 / TAU]);
    assert_eq!(values(&path, "mimic", "joint"), ["a <pair>-turn"]);
    let masses = numbers("mass", "value");
    assert_eq!(masses.len(), 3);
    for (found, expected) in masses.iter().zip([0.12, 6e-7, 0.006]) {
        assert!((found - expected).abs() < 1e-12, "{masses:?}");
    }
    let cylinder = joint(JointKind::Cylindrical);
    write_urdf(&pair(&meshes, &cylinder), &path).unwrap();
    assert_eq!(numbers("limit", "lower"), [-0.004]);
    assert_eq!(numbers("limit", "upper"), [0.03]);
}

#[test]
fn an_mjcf_has_the_joints_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.xml");
    let expected: [&[&str]; 8] = [
        &[],
        &["slide"],
        &["hinge"],
        &["slide", "hinge"],
        &["hinge", "slide"],
        &["slide", "slide", "hinge"],
        &["ball"],
        &[],
    ];
    let meshes = parts();
    for (kind, expected) in KINDS.into_iter().zip(expected) {
        let joint = joint(kind);
        write_mjcf(&pair(&meshes, &joint), &path).unwrap();
        assert_eq!(values(&path, "joint", "type"), *expected, "{kind:?}");
        let free = values(&path, "freejoint", "name").len();
        assert_eq!(free == 1, matches!(kind, JointKind::Undetermined(_)));
        // The slide and the turn of a screw are tied.
        let tied: &[String] = match kind {
            JointKind::Screw => &["1.0".to_owned(), format!("{:?}", 0.002 / TAU)],
            _ => &[],
        };
        assert_eq!(values(&path, "joint", "coef"), tied);
        assert_eq!(values(&path, "tendon", "tendon1").len(), tied.len() / 2);
        assert_eq!(values(&path, "exclude", "body2"), ["a <pair>-moving"]);
        assert_eq!(
            values(&path, "mesh", "file"),
            ["out-fixed.obj", "out-moving.obj"]
        );
    }
}

/// The pair in its hole, both frames turned and shifted.
fn docked(section: PegInHole) -> (TriangleMesh, TriangleMesh, Pose) {
    let (hole, peg) = section.pair(1e-4).unwrap();
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
    let shift = DVec3::new(0.3, 0.2, -0.1);
    let own = Pose::new(turn, shift);
    let pose = own.inverse();
    (hole, peg.transformed(turn, shift), pose)
}

fn joint_of(fixed: &TriangleMesh, moving: &TriangleMesh, pose: &Pose) -> Joint {
    let features = [fixed, moving].map(SurfaceFeatures::new);
    let contact = MatingContact::new([fixed, moving], [&features[0], &features[1]], None);
    contact.joint(pose)
}

#[test]
fn a_square_peg_in_its_hole_has_four_coincident_walls() {
    let (fixed, moving, pose) = docked(PegInHole::Rectangular);
    let joint = joint_of(&fixed, &moving, &pose);
    assert_eq!(joint.kind, JointKind::Prismatic);
    let pair = DockedPair {
        name: "square",
        fixed: &fixed,
        moving: &moving,
        placed: Pose::IDENTITY,
        pose,
        joint: &joint,
        clearance: None,
        kept: Vec::new(),
    };
    let found = mates(&pair);
    assert_eq!(found.mates.len(), 4, "{:?}", found.mates);
    for mate in &found.mates {
        assert_eq!(mate.kind, MateKind::CoincidentPlanes);
        assert!((mate.offset - 1e-4).abs() < 1e-9, "{}", mate.offset);
        assert!((mate.area - 0.02 * 0.03).abs() < 1e-9);
        let vector = |v: Option<[f64; 3]>| DVec3::from_array(v.unwrap());
        let (a, b) = (vector(mate.fixed.normal), vector(mate.moving.normal));
        assert!(a.dot(pose.rotation * b) < -1.0 + 1e-9);
        // The middle of a wall, 10.1 mm from the axis; of the peg 10 mm.
        let on_fixed = DVec3::from_array(mate.fixed.point);
        assert!((on_fixed.length() - 0.0101).abs() < 1e-9, "{on_fixed}");
        let on_moving = pose.apply(DVec3::from_array(mate.moving.point));
        assert!((on_moving.length() - 0.010).abs() < 1e-9);
        // The triangles lie in these planes.
        for (mesh, side, n) in [(&fixed, &mate.fixed, a), (&moving, &mate.moving, b)] {
            assert_eq!(side.faces.len(), 2);
            let point = DVec3::from_array(side.point);
            for face in &side.faces {
                let corners = mesh.corners(*face as usize);
                assert!(corners.iter().all(|c| (*c - point).dot(n).abs() < 1e-9));
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mates.json");
    write_mates(&pair, &path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["joint"]["kind"], "prismatic");
    assert_eq!(value["mates"][3]["kind"], "coincident-planes");
    assert_eq!(value["fixed"]["mesh"], "mates-fixed.obj");
    assert!(folder.path().join("mates-moving.obj").is_file());
}

#[test]
fn a_round_peg_in_its_hole_is_concentric_with_it() {
    let (fixed, moving, pose) = docked(PegInHole::Circular);
    let joint = joint_of(&fixed, &moving, &pose);
    assert_eq!(joint.kind, JointKind::Cylindrical);
    let pair = DockedPair {
        name: "round",
        fixed: &fixed,
        moving: &moving,
        placed: Pose::IDENTITY,
        pose,
        joint: &joint,
        clearance: None,
        kept: Vec::new(),
    };
    let found = mates(&pair);
    assert_eq!(found.mates.len(), 1, "{:?}", found.mates);
    let mate = &found.mates[0];
    assert_eq!(mate.kind, MateKind::ConcentricCylinders);
    assert!(mate.offset < 1e-9);
    assert!((mate.clearance.unwrap() - 1e-4).abs() < 1e-6);
    assert_eq!(mate.fixed.faces.len(), 192);
    assert_eq!(mate.moving.faces.len(), 192);
    let at = pose.apply(DVec3::from_array(mate.moving.point));
    assert!(at.distance(DVec3::from_array(mate.fixed.point)) < 1e-9);
}

#[test]
fn a_ball_in_its_pocket_is_concentric_with_it() {
    let (fixed, moving) = pegfit_fixtures::captive_ball(1e-4, 5e-4).unwrap();
    let joint = joint_of(&fixed, &moving, &Pose::IDENTITY);
    assert_eq!(joint.kind, JointKind::Ball);
    let pair = DockedPair {
        name: "ball",
        fixed: &fixed,
        moving: &moving,
        placed: Pose::IDENTITY,
        pose: Pose::IDENTITY,
        joint: &joint,
        clearance: None,
        kept: Vec::new(),
    };
    let found = mates(&pair);
    assert_eq!(found.mates.len(), 1, "{:?}", found.mates);
    assert_eq!(found.mates[0].kind, MateKind::ConcentricSpheres);
    let radius = found.mates[0].moving.radius.unwrap();
    assert!((radius - 0.004).abs() < 1e-5, "{radius}");
}

#[test]
fn meshes_of_the_scene_are_not_replaced_and_a_path_without_a_name_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = parts();
    let joint = joint(JointKind::Fixed);
    let own = folder.path().join("part-fixed.obj");
    mesh_io::write_obj(&own, &meshes.1).unwrap();
    let before = std::fs::read(&own).unwrap();
    let mut pair = pair(&meshes, &joint);
    pair.kept = vec![folder.path().join("./part-fixed.obj")];
    let path = folder.path().join("part.urdf");
    let error = write_urdf(&pair, &path).unwrap_err();
    assert!(matches!(error, ExportError::Replaces { .. }), "{error}");
    assert!(error.to_string().contains("part.urdf"));
    assert_eq!(std::fs::read(&own).unwrap(), before);
    assert!(!path.exists());
    let error = write_mjcf(&pair, Path::new("/")).unwrap_err();
    assert!(matches!(error, ExportError::NoName { .. }), "{error}");
}
