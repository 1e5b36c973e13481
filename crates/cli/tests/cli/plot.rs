//! `pegfit plot` from the outside.

use crate::common::{cuboid_obj, pegfit, refuse, scene_folder, stderr, stdout, succeed, words};

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

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("box.obj"), cuboid_obj([4.0, 4.0, 6.0])).unwrap();
    folder
}

#[test]
fn a_field_and_its_picture_are_written() {
    let folder = folder();
    let output = pegfit(
        folder.path(),
        &[
            "field",
            "box.obj",
            "--unit",
            "mm",
            "--spacing",
            "1",
            "-o",
            "f.vti",
            "--slice",
            "y=0.5",
            "--png",
            "f.png",
            "--json",
            "--quiet",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary["triangles"], 12);
    assert_eq!(summary["spacing_m"], 1e-3);
    // 4 x 4 x 6 mm and a quarter of 6 mm around it, in whole cells.
    assert_eq!(summary["nodes"], serde_json::json!([8, 8, 10]));
    let image = std::fs::read(folder.path().join("f.vti")).unwrap();
    assert!(image.starts_with(b"<?xml") && image.ends_with(b"</VTKFile>\n"));
    let png = std::fs::read(folder.path().join("f.png")).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    let folder = folder();
    let cases: [(&[&str], &str); 8] = [
        (
            &["box.obj"],
            "--output, --png or --skeleton: expected a file to write",
        ),
        (
            &["box.obj", "-o", "no/such/f.vti"],
            "expected an existing folder",
        ),
        (
            &["box.obj", "-o", "f.vti", "--spacing", "0"],
            "expected a positive number, found 0",
        ),
        (&["box.obj", "-o", "f.vti", "--sigma", "0.9"], "0.9"),
        (&["box.obj", "-o", "f.vti", "--tolerance", "1"], "tolerance"),
        (
            &["box.obj", "--png", "f.png", "--slice", "w=1"],
            "found w=1",
        ),
        (&["no.obj", "-o", "f.vti"], "no.obj"),
        // 6e6 nodes per axis: refused by the count of nodes or by the memory.
        (&["box.obj", "-o", "f.vti", "--spacing", "1e-6"], "lattice"),
    ];
    for (args, message) in cases {
        let output = pegfit(folder.path(), &[&["field"], args].concat());
        assert_eq!(
            output.status.code(),
            Some(2),
            "{args:?}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(message),
            "{args:?}: {}",
            stderr(&output)
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_field_beyond_the_memory_is_refused_with_the_number() {
    let folder = folder();
    // (4 + 2 * 1.5 mm) / 0.01 mm = 700 nodes twice, 900 once, 20 bytes each: 8.2 GiB.
    let args = words("field box.obj -o f.vti --spacing 0.01 --memory 2");
    let output = pegfit(folder.path(), &args);
    assert_eq!(output.status.code(), Some(2));
    let text = stderr(&output);
    assert!(text.contains("the field needs about 8.2 GiB"), "{text}");
    assert!(text.contains("only 2.0 GiB"), "{text}");
    assert!(!folder.path().join("f.vti").exists());
}
