//! `pegfit plot` from the outside.

use crate::common::{refuse, scene_folder, succeed};

fn is_png(path: &std::path::Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| bytes.len() > 1000 && &bytes[1..4] == b"PNG")
}

#[test]
fn surfaces_and_curves_are_drawn() {
    let folder = scene_folder("");
    let cases: [&[&str]; 4] = [
        &["score", "scene.toml", "-o", "p.png"],
        &["score", "scene.toml", "--along", "yx", "-o", "p.png"],
        &["energy", "scene.toml", "--along", "z", "-o", "p.png"],
        &["energy", "scene.toml", "--along", "rz", "-o", "p.png"],
    ];
    for args in cases {
        let path = folder.path().join("p.png");
        let _ = std::fs::remove_file(&path);
        succeed(folder.path(), &[&["plot", "-q"], args].concat());
        assert!(is_png(&path), "{args:?}");
    }
}

#[test]
fn slices_are_drawn() {
    let folder = scene_folder("");
    for kind in ["density", "overlap"] {
        let path = folder.path().join(format!("{kind}.png"));
        let name = path.file_name().unwrap().to_str().unwrap();
        let args = [
            "plot",
            kind,
            "scene.toml",
            "--slice",
            "z=0.001",
            "-o",
            name,
            "-q",
        ];
        succeed(folder.path(), &args);
        assert!(is_png(&path), "{kind}");
    }
}

#[test]
fn forces_of_both_tests_are_drawn() {
    let folder = scene_folder("");
    succeed(
        folder.path(),
        &["plot", "force", "scene.toml", "-o", "p.png", "-q"],
    );
    assert!(is_png(&folder.path().join("p.png")));
}

#[test]
fn the_well_is_told_in_numbers() {
    let folder = scene_folder("");
    let text = succeed(
        folder.path(),
        &["plot", "well", "scene.toml", "--json", "-q"],
    );
    let well: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(well["depth"].as_f64().unwrap() > 0.0);
    assert!(well["translations"][0]["stiffness"].as_f64().unwrap() > 0.0);
    let text = succeed(folder.path(), &["plot", "well", "scene.toml", "-q"]);
    for word in ["depth", "stiffness", "barriers", "N/m"] {
        assert!(text.contains(word), "{text}");
    }
}

#[test]
fn options_that_do_not_belong_are_refused() {
    let folder = scene_folder("");
    let cases: [(&[&str], &str); 6] = [
        (
            &["density", "scene.toml"],
            "--output: expected a picture file",
        ),
        (&["well", "scene.toml", "-o", "p.png"], "--output"),
        (
            &["score", "scene.toml", "-o", "p.png", "--slice", "y=0"],
            "--slice",
        ),
        (
            &["density", "scene.toml", "-o", "p.png", "--along", "x"],
            "--along",
        ),
        (
            &["score", "scene.toml", "-o", "p.png", "--along", "xx"],
            "found xx",
        ),
        (
            &["energy", "scene.toml", "-o", "p.png", "--along", "w"],
            "found w",
        ),
    ];
    for (args, message) in cases {
        let said = refuse(folder.path(), &[&["plot"], args].concat());
        assert!(said.contains(message), "{args:?}: {said}");
    }
    assert!(!folder.path().join("p.png").exists());
}
