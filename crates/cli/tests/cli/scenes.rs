//! Scenes of several fixed parts, and the page about a run.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::time::Duration;

use fft_correlate::{Placement, Pose};
use glam::{DQuat, DVec3};
use serde_json::json;
use tempfile::TempDir;

use crate::common::{columns, cuboid_obj, refuse, scene_folder, succeed, words};

/// The hole of `scene_folder` as one part of several: a wall of two boxes beside it, and a part far
/// away.
fn several(folder: &Path, extra: &str) {
    std::fs::write(folder.join("brick.obj"), cuboid_obj([0.01, 0.04, 0.04])).unwrap();
    let old = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    let rest = old.replace("fixed = \"hole.obj\"\n", "");
    let parts = "\n[[fixed]]\nmesh = \"hole.obj\"\n\
         [[fixed]]\nname = \"wall\"\nposition = [0.05, 0, 0]\n\
         meshes = [\"brick.obj\", { mesh = \"brick.obj\", position = [0.01, 0, 0] }]\n\
         [[fixed]]\nname = \"far\"\nmesh = \"brick.obj\"\nposition = [1, 0, 0]\n";
    std::fs::write(folder.join("scene.toml"), rest + extra + parts).unwrap();
}

#[test]
fn several_parts_are_felt_together_and_told_about_on_a_page() {
    let folder = scene_folder("");
    several(folder.path(), "");
    let args = words("feel scene.toml --seconds 0.5 --report r.html -q");
    let said = succeed(folder.path(), &args);
    assert!(said.contains("peak force"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("r.html")).unwrap();
    let (first, folded) = page.split_once("<details>").unwrap();
    for word in ["<svg", "greatest force", "limit"] {
        assert!(first.contains(word), "{word}");
    }
    let words = [
        "Energy bookkeeping",
        "SCHED_FIFO",
        "part hole",
        "part wall",
        "not loaded: far away",
    ];
    for word in words {
        assert!(folded.contains(word) && !first.contains(word), "{word}");
    }
    // The part moves among all others.
    let data = page.split("application/json\">").nth(1).unwrap();
    let data: serde_json::Value =
        serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
    let act = &data["acts"][0];
    assert_eq!(
        (&act["moving"], &act["staying"]),
        (&json!([3]), &json!([0, 1, 2]))
    );
    assert_eq!(data["parts"].as_array().unwrap().len(), 4);
    let poses = act["poses"].as_array().unwrap();
    assert!(poses.len() > 100 && poses[0]["pose"] != poses[poses.len() - 1]["pose"]);
    assert!(
        poses
            .windows(2)
            .all(|p| p[0]["time"].as_f64() < p[1]["time"].as_f64())
    );
    // Nothing is fetched: no address, no file.
    for word in ["http", "src=", "url(", "@import"] {
        assert!(!page.contains(word), "{word}");
    }
}

#[test]
fn other_commands_ask_which_part_is_meant() {
    let folder = scene_folder("");
    several(folder.path(), "");
    let said = refuse(folder.path(), &["dock", "scene.toml", "-q"]);
    assert!(
        said.contains("--fixed NAME") && said.contains("hole, wall, far"),
        "{said}"
    );
    let said = refuse(
        folder.path(),
        &["bake", "scene.toml", "-o", "t.zarr", "--fixed", "wal", "-q"],
    );
    assert!(said.contains("`wal`"), "{said}");
}

#[test]
fn a_memory_budget_that_is_too_small_is_refused_with_both_numbers() {
    let folder = scene_folder("");
    several(folder.path(), "[loading]\nmemory_mib = 0.001\n");
    let said = refuse(folder.path(), &["feel", "scene.toml", "-q"]);
    assert!(
        said.contains("loading.memory_mib") && said.contains("hole"),
        "{said}"
    );
}

/// The page of a run with three holes in three places, one of them turned, and memory for one; and
/// how many fields it took.
fn three_holes(meshes: [&str; 3]) -> (String, usize) {
    let folder = scene_folder("");
    for copy in ["second.obj", "third.obj"] {
        std::fs::copy(folder.path().join("hole.obj"), folder.path().join(copy)).unwrap();
    }
    let path = folder.path().join("scene.toml");
    let old = std::fs::read_to_string(&path).unwrap();
    let mut scene = old.replace("fixed = \"hole.obj\"\n", "");
    scene += "[loading]\nmemory_mib = 3.5\nahead = 1.0\n";
    let places = [
        "position = [0, 0, 0]",
        "position = [0.3, 0, 0]\nrotation = [0, 0, 0.6, 0.8]",
        "position = [0, 0.3, 0]",
    ];
    for (k, (mesh, place)) in meshes.iter().zip(places).enumerate() {
        scene += &format!("[[fixed]]\nname = \"hole {k}\"\nmeshes = [{mesh}]\n{place}\n");
    }
    std::fs::write(&path, scene).unwrap();
    let args = ["feel", "scene.toml", "--seconds", "1", "--report", "r.html"];
    println!("{}", succeed(folder.path(), &args));
    let page = std::fs::read_to_string(folder.path().join("r.html")).unwrap();
    let cache = std::fs::read_dir(folder.path().join(".pegfit-cache")).unwrap();
    (page, cache.count())
}

#[test]
fn the_same_part_in_several_places_shares_its_memory() {
    // Where the only mesh of a part lies is where the part stands.
    let (page, fields) = three_holes([
        "\"hole.obj\"",
        "\"hole.obj\"",
        "{ mesh = \"hole.obj\", rotation = [0, 0.6, 0, 0.8] }",
    ]);
    assert_eq!(page.matches("<td>loaded</td>").count(), 3);
    assert_eq!(fields, 2, "the hole and the peg");
    // From files of their own: nothing to share, and no room.
    let (page, _) = three_holes(["\"hole.obj\"", "\"second.obj\"", "\"third.obj\""]);
    assert!(page.contains("not loaded: no room"));
}

#[test]
fn a_part_that_changes_is_loaded_again_while_the_loop_runs() {
    let folder = scene_folder("[loading]\nwatch_s = 0.05\n");
    let mesh = folder.path().join("hole.obj");
    let text = std::fs::read_to_string(&mesh).unwrap();
    // The same shape in a file of another length, written when the loop has begun.
    let writer = std::thread::spawn(move || {
        for k in 0..200 {
            std::thread::sleep(Duration::from_millis(250));
            if std::fs::write(&mesh, format!("# {}\n{text}", "x".repeat(k + 1))).is_err() {
                return;
            }
        }
    });
    let said = succeed(folder.path(), &["feel", "scene.toml", "--seconds", "4"]);
    drop(folder);
    assert!(said.contains("hole: changed and loaded again"), "{said}");
    // It ends by itself once the folder is gone.
    drop(writer);
}

#[test]
fn a_log_of_a_kind_that_is_not_built_in_is_refused_before_anything_is_computed() {
    let folder = scene_folder("");
    let args = words("feel scene.toml --log l.parquet --seconds 0.1 -q");
    if cfg!(feature = "parquet") {
        succeed(folder.path(), &args);
        let log = std::fs::read(folder.path().join("l.parquet")).unwrap();
        assert_eq!(&log[..4], b"PAR1");
    } else {
        let said = refuse(folder.path(), &args);
        assert!(said.contains("--features parquet"), "{said}");
    }
}

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
        assert_eq!(own["hold"], placed["hold"]);
    }
}
