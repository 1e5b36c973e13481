//! Scenes of several fixed parts, and the page about a run.

use std::path::Path;
use std::time::Duration;

use crate::common::{cuboid_obj, refuse, scene_folder, succeed};

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
    let args = [
        "feel",
        "scene.toml",
        "--seconds",
        "0.5",
        "--report",
        "r.html",
        "-q",
    ];
    let said = succeed(folder.path(), &args);
    assert!(said.contains("peak force"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("r.html")).unwrap();
    for word in [
        "<svg",
        "Energy bookkeeping",
        "SCHED_FIFO",
        "part hole",
        "part wall",
        "not loaded: far away",
        "input",
        "deadlines left out",
    ] {
        assert!(page.contains(word), "{word}");
    }
    // Nothing is fetched: no address, no script, no file.
    for word in ["http", "<script", "src=", "url(", "@import"] {
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
    scene += "[loading]\nmemory_mib = 4.0\nahead = 1.0\n";
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
    let args = [
        "feel",
        "scene.toml",
        "--log",
        "l.parquet",
        "--seconds",
        "0.1",
        "-q",
    ];
    if cfg!(feature = "parquet") {
        succeed(folder.path(), &args);
        let log = std::fs::read(folder.path().join("l.parquet")).unwrap();
        assert_eq!(&log[..4], b"PAR1");
    } else {
        let said = refuse(folder.path(), &args);
        assert!(said.contains("--features parquet"), "{said}");
    }
}
