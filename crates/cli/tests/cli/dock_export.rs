//! `pegfit dock --urdf --mjcf --mates` from the outside.

use serde_json::Value;

use crate::common::{refuse, scene_folder, succeed};

#[test]
fn the_best_pose_is_written_with_its_joint_and_no_mesh_of_the_scene_is_replaced() {
    let folder = scene_folder("");
    let file = |name: &str| folder.path().join(name);
    succeed(
        folder.path(),
        &[
            "dock",
            "scene.toml",
            "--top",
            "1",
            "-o",
            "out.csv",
            "-q",
            "--urdf",
            "pair.urdf",
            "--mjcf",
            "pair.xml",
            "--mates",
            "pair.json",
        ],
    );
    let text = |name: &str| std::fs::read_to_string(file(name)).unwrap();
    let mates: Value = serde_json::from_str(&text("pair.json")).unwrap();
    assert_eq!(mates["name"], "scene");
    let meshes = ["fixed", "moving"].map(|part| mates[part]["mesh"].as_str().unwrap().to_owned());
    assert_eq!(meshes, ["pair-fixed.obj", "pair-moving.obj"]);
    assert!(meshes.iter().all(|mesh| file(mesh).is_file()));
    assert!(text("pair.urdf").contains("<link name=\"scene-moving\">"));
    assert!(text("pair.xml").contains("<body name=\"scene-moving\""));
    // What was written reads as solids in their places.
    let listed = succeed(folder.path(), &["scene", "pair.urdf"]);
    assert!(listed.contains("scene-moving"), "{listed}");
    // A mesh of the scene that is called as one to be written.
    std::fs::rename(file("peg.obj"), file("new-moving.obj")).unwrap();
    let scene = text("scene.toml").replace("peg.obj", "new-moving.obj");
    std::fs::write(file("scene.toml"), scene).unwrap();
    let before = text("new-moving.obj");
    let said = refuse(
        folder.path(),
        &[
            "dock",
            "scene.toml",
            "--top",
            "1",
            "-o",
            "out.csv",
            "--urdf",
            "new.urdf",
        ],
    );
    assert!(said.contains("would replace a mesh of the scene"), "{said}");
    assert_eq!(text("new-moving.obj"), before);
}
