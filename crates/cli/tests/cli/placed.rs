//! Scenes that place their parts: the shapes are those of the scene that does not.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use fft_correlate::{Placement, Pose};
use glam::{DQuat, DVec3};
use tempfile::TempDir;

use crate::common::{columns, scene_folder, succeed};

/// Turned by a third and by a half of a full turn and shifted by powers of two: nothing is rounded.
fn exact() -> Placement {
    Placement {
        fixed: Pose {
            rotation: DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5),
            translation: DVec3::new(4.0, -0.5, 0.25),
        },
        moving: Pose {
            rotation: DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0),
            translation: DVec3::new(-0.125, 2.0, 0.0625),
        },
    }
}

/// Turned anyhow, metres away.
fn oblique() -> Placement {
    let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
    Placement {
        fixed: Pose::new(turn(0.4, -1.1, 0.7), DVec3::new(3.0, -2.0, 0.9)),
        moving: Pose::new(turn(-0.8, 0.2, 2.1), DVec3::new(-0.1, 5.0, 0.4)),
    }
}

fn keys(pose: &Pose) -> String {
    let (t, q) = (pose.translation.to_array(), pose.rotation.to_array());
    format!("position = {t:?}, rotation = {q:?}")
}

/// `scene_folder`, and in it `placed.toml`, whose shapes are placed and fit where they did, and
/// whose rotations are a ball about the fit.
fn folder(placement: &Placement, extra: &str) -> TempDir {
    let ball = |center: &Pose| {
        let center = center.rotation.to_array();
        format!("[rotations]\nkind = \"ball\"\ncenter = {center:?}\nangle_deg = 12\nstep_deg = 6\n")
    };
    let folder = scene_folder(&(extra.to_owned() + &ball(&Pose::IDENTITY)));
    let fit = placement.to_scene(&Pose::IDENTITY);
    let scene = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let part = |name: &str, pose: &Pose| format!("{{ mesh = \"{name}.obj\", {} }}", keys(pose));
    let placed = scene
        .replace("\"hole.obj\"", &part("hole", &placement.fixed))
        .replace("\"peg.obj\"", &part("peg", &placement.moving))
        .replace(&ball(&Pose::IDENTITY), &ball(&fit))
        + &format!("[fit]\n{}\n", keys(&fit).replace(", rot", "\nrot"));
    std::fs::write(folder.path().join("placed.toml"), placed).unwrap();
    folder
}

fn fields(folder: &Path) -> usize {
    std::fs::read_dir(folder.join(".pegfit-cache"))
        .unwrap()
        .count()
}

type Row = HashMap<String, f64>;

fn vector(row: &Row, names: [&str; 3]) -> DVec3 {
    DVec3::from_array(names.map(|n| row[n]))
}

fn pose(row: &Row) -> Pose {
    let rotation = DQuat::from_array(["qx", "qy", "qz", "qw"].map(|n| row[n]));
    Pose::new(rotation, vector(row, ["x", "y", "z"]))
}

/// Scores at poses, by a scene or a table.
fn score(folder: &Path, of: [&str; 2], poses: &[Pose]) -> Vec<Row> {
    let mut text = "x,y,z,qx,qy,qz,qw\n".to_owned();
    for pose in poses {
        let [x, y, z] = pose.translation.to_array();
        let [a, b, c, d] = pose.rotation.to_array();
        text += &format!("{x},{y},{z},{a},{b},{c},{d}\n");
    }
    std::fs::write(folder.join("in.csv"), text).unwrap();
    let args = ["score", of[0], of[1], "--poses", "in.csv", "-q"];
    columns(&succeed(folder, &args))
}

fn poses() -> Vec<Pose> {
    let pose = |k: u32| {
        let s = f64::from(k);
        let at = DVec3::new((1.3 * s).sin(), s.cos(), (0.7 * s).sin());
        let turn = DVec3::new(s.cos(), (1.7 * s).sin(), (0.3 * s).cos());
        Pose::new(DQuat::from_scaled_axis(0.1 * turn), 0.003 * at)
    };
    (0..12).map(pose).collect()
}

/// `placed` at poses in the scene says what `own` says at those of the shapes, to a share of it.
fn assert_transformed(placement: &Placement, own: &[Row], placed: &[Row], share: f64) {
    assert_eq!(own.len(), placed.len());
    for (own, placed) in own.iter().zip(placed) {
        let near = |a: f64, b: f64| (a - b).abs() < share * b.abs();
        assert!(near(placed["energy"], own["energy"]), "{own:?} {placed:?}");
        assert!(near(placed["score_re"], own["score_re"]));
        let (f, t) = (["fx", "fy", "fz"], ["tx", "ty", "tz"]);
        let turn = placement.fixed.rotation;
        let force = turn * vector(own, f);
        assert!((vector(placed, f) - force).length() < share * force.length());
        // About the origin of what the pose moves, metres from the shape's.
        let arm = pose(placed).rotation * placement.moving.translation;
        let torque = turn * vector(own, t) + arm.cross(force);
        let size = torque.length() + arm.length() * force.length();
        assert!((vector(placed, t) - torque).length() < share * size);
    }
}

#[test]
fn placed_parts_have_the_energies_and_the_fields_of_their_shapes() {
    let placement = oblique();
    let folder = folder(&placement, "[energy]\ngamma = 2e6\n");
    let poses = poses();
    let own = score(folder.path(), ["--scene", "scene.toml"], &poses);
    let cached = fields(folder.path());
    let there: Vec<Pose> = poses.iter().map(|p| placement.to_scene(p)).collect();
    let placed = score(folder.path(), ["--scene", "placed.toml"], &there);
    assert_transformed(&placement, &own, &placed, 1e-9);
    assert_eq!((cached, fields(folder.path())), (2, 2));
}

#[test]
fn a_table_of_placed_parts_is_that_of_their_shapes_and_answers_in_the_scene() {
    let placement = exact();
    let folder = folder(&placement, "");
    for name in ["scene", "placed"] {
        let (scene, table) = (format!("{name}.toml"), format!("{name}.zarr"));
        succeed(folder.path(), &["bake", &scene, "-o", &table, "-q"]);
    }
    let chunks = |table: &str| {
        let files = std::fs::read_dir(folder.path().join(table).join("coefficients")).unwrap();
        let read = |file: std::io::Result<std::fs::DirEntry>| {
            let path = file.unwrap().path();
            let name = path.file_name().unwrap().to_owned();
            (name, std::fs::read(&path).unwrap())
        };
        files.map(read).collect::<BTreeMap<_, _>>()
    };
    let plain = chunks("scene.zarr");
    assert!(plain.len() > 20 && plain == chunks("placed.zarr"));
    let poses = poses();
    let own = score(folder.path(), ["--table", "scene.zarr"], &poses);
    let there: Vec<Pose> = poses.iter().map(|p| placement.to_scene(p)).collect();
    let placed = score(folder.path(), ["--table", "placed.zarr"], &there);
    assert!(own.iter().all(|r| r["coverage"] == 1.0));
    // Tables are read in single precision.
    assert_transformed(&placement, &own, &placed, 1e-4);
    // The same shapes: one table serves both scenes.
    for scene in ["scene.toml", "placed.toml"] {
        let args = [
            "verify",
            "scene.zarr",
            "--scene",
            scene,
            "--margin",
            "1",
            "-q",
        ];
        succeed(folder.path(), &args);
    }
}

#[test]
fn docking_finds_poses_in_the_scene() {
    let placement = exact();
    let folder = folder(&placement, "");
    let dock = |name: &str| {
        let args = ["dock", name, "--top", "2", "-o", "out.csv", "-q"];
        succeed(folder.path(), &args);
        columns(&std::fs::read_to_string(folder.path().join("out.csv")).unwrap())
    };
    let (own, placed) = (dock("scene.toml"), dock("placed.toml"));
    assert!(!own.is_empty() && own.len() == placed.len());
    for (own, placed) in own.iter().zip(&placed) {
        let (expected, found) = (placement.to_scene(&pose(own)), pose(placed));
        // Poses are printed in full; those of the scene are rounded at metres.
        assert!((expected.translation - found.translation).length() < 1e-12);
        assert!(expected.angle_to(&found) < 1e-7);
        assert_eq!(own["energy"], placed["energy"]);
    }
}
