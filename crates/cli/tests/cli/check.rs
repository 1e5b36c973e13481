//! `pegfit check` from the outside.

use crate::common::{cuboid_obj, pegfit, refuse, scene_folder, stderr, stdout};

#[test]
fn a_good_mesh_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("box.obj"), cuboid_obj([2.0, 3.0, 4.0])).unwrap();
    let output = pegfit(folder.path(), &["check", "box.obj", "--unit", "mm"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    for part in [
        "box.obj: usable",
        "triangles    12 of 12 kept",
        "watertight   yes",
        "24.000000 mm³",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn what_is_read_ignored_and_assumed_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("vn 0 0 1\nl 1 2\n{}", cuboid_obj([2.0, 3.0, 4.0]));
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("box.obj", &text);
    for command in ["check", "scene"] {
        let output = pegfit(folder.path(), &[command, "box.obj"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let said = stdout(&output);
        for line in [
            "read         8 v, ",
            "ignored      l: ",
            "assumed      unit: mm",
        ] {
            assert!(said.contains(line), "{command}: {said}");
        }
        let output = pegfit(folder.path(), &[command, "box.obj", "--json"]);
        let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        let ledger = match command {
            "check" => &value["meshes"][0]["ledger"],
            _ => &value["ledger"],
        };
        assert_eq!(ledger[0]["kind"], "ignored", "{ledger}");
        assert_eq!(ledger[0]["item"], "vn", "{ledger}");
        assert_eq!(ledger[0]["count"], 1, "{ledger}");
    }
    // What would change the solid is refused, by name, unless asked for: in a scene, too.
    write("call.obj", &format!("{text}call other.obj\n"));
    let output = pegfit(folder.path(), &["check", "call.obj"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stdout(&output).contains("--lossy"), "{}", stdout(&output));
    let output = pegfit(folder.path(), &["check", "call.obj", "--lossy"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    assert!(
        stdout(&output).contains("ignored      call: "),
        "{}",
        stdout(&output)
    );
    for (lossy, code) in [("", 3), ("lossy = true\n", 0)] {
        let scene =
            format!("unit = \"mm\"\nmoving = \"box.obj\"\n[fixed]\nmesh = \"call.obj\"\n{lossy}");
        write("scene.toml", &scene);
        let output = pegfit(folder.path(), &["check", "scene.toml"]);
        assert_eq!(output.status.code(), Some(code), "{}", stdout(&output));
    }
    let scene =
        "unit = \"mm\"\nmoving = \"box.obj\"\n[fixed]\nmesh = \"box.obj\"\nstep_time_limit = 0\n";
    write("scene.toml", scene);
    let output = pegfit(folder.path(), &["check", "scene.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("expected 1 to 86400 s"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn escapes_in_names_never_reach_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let cube = cuboid_obj([2.0, 3.0, 4.0]);
    // Both solids on the same vertices.
    let faces: Vec<&str> = cube.lines().filter(|line| line.starts_with('f')).collect();
    let faces = faces.join("\n");
    let text = format!("o a\x1b[31m\n{cube}\no b\u{9b}2J\u{202e}\n{faces}\n");
    std::fs::write(folder.path().join("box.obj"), &text).unwrap();
    for args in [
        &["check", "box.obj"][..],
        &["check", "box.obj", "--json"],
        &["check", "box.obj", "--solid", "c\x1b[2J"],
        &["scene", "box.obj"],
        &["scene", "box.obj", "--moving", "c\x1b[2J"],
    ] {
        let output = pegfit(folder.path(), args);
        let said = stdout(&output) + &stderr(&output);
        for mark in ['\x1b', '\u{9b}', '\u{202e}'] {
            assert!(!said.contains(mark), "{args:?}: {said:?}");
        }
        assert!(
            said.contains("u{1b}") || said.contains("u001b"),
            "{args:?}: {said}"
        );
    }
}

#[test]
fn a_scene_stands_for_its_meshes_as_it_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("box.obj", &cuboid_obj([2.0, 3.0, 4.0]));
    write("pin.obj", &cuboid_obj([1.0, 1.0, 5.0]));
    let parts = "moving = \"pin.obj\"\n[[fixed]]\nname = \"a\"\nmesh = \"box.obj\"\n\
                 [[fixed]]\nname = \"b\"\nmesh = \"box.obj\"\nposition = [9, 0, 0]\n";
    write("scene.toml", &format!("unit = \"cm\"\n{parts}"));
    let check = |args: &[&str]| pegfit(folder.path(), args);
    let output = check(&["check", "scene.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    // Each mesh once, in the scene's unit.
    assert_eq!(text.matches("usable").count(), 2, "{text}");
    assert!(text.contains("24.000000 cm³") && text.contains("5.000000 cm³"));
    // The scene itself may be wrong, or one of its meshes.
    write("scene.toml", &format!("unit = \"ell\"\n{parts}"));
    assert_eq!(check(&["check", "scene.toml"]).status.code(), Some(2));
    write("scene.toml", &format!("unit = \"cm\"\n{parts}"));
    write("pin.obj", "v 0 0 0\n");
    let output = check(&["check", "scene.toml", "--json"]);
    assert_eq!(output.status.code(), Some(3));
    let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(value["meshes"][0]["usable"], true);
    assert_eq!(value["meshes"][1]["usable"], false);
    // Without both meshes there is nothing to say of the pairs.
    assert_eq!(value["pairs"], serde_json::json!([]));
    // Meshes and scenes together are still one document, and each pair names its scene.
    write("pin.obj", &cuboid_obj([1.0, 1.0, 5.0]));
    let output = check(&["check", "box.obj", "scene.toml", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let told = |list: &str, key: &str| -> Vec<String> {
        let items = value[list].as_array().unwrap();
        let text = |item: &serde_json::Value| item[key].as_str().unwrap().to_owned();
        items.iter().map(text).collect()
    };
    let keys: Vec<&String> = value.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["meshes", "pairs"]);
    assert_eq!(told("meshes", "name"), ["box.obj", "box.obj", "pin.obj"]);
    assert_eq!(told("pairs", "fixed"), ["a", "b"]);
    assert_eq!(told("pairs", "moving"), ["pin", "pin"]);
    assert_eq!(told("pairs", "scene"), ["scene.toml", "scene.toml"]);
}

#[test]
fn json_parses_and_repairs_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let inverted = cuboid_obj([2.0, 3.0, 4.0])
        .lines()
        .map(
            |line| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["f", a, b, c] => format!("f {a} {c} {b}\n"),
                _ => format!("{line}\n"),
            },
        )
        .collect::<String>();
    std::fs::write(folder.path().join("box.obj"), inverted).unwrap();
    let output = pegfit(folder.path(), &["check", "box.obj", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let mesh = &value["meshes"][0];
    assert_eq!(mesh["flipped_faces"], 12);
    assert_eq!(mesh["usable"], true);
    assert!((mesh["volume"].as_f64().unwrap() - 24e-9).abs() < 1e-20);
    assert!(mesh["warnings"][0].as_str().unwrap().contains("reversed"));
    assert_eq!(value["pairs"], serde_json::json!([]));
}

#[test]
fn unusable_meshes_exit_with_three() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("good.obj", &cuboid_obj([1.0, 1.0, 1.0]));
    write("empty.obj", "v 0 0 0\n");
    write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let cases = [
        ("missing.obj", "No such file", 2),
        ("empty.obj", "at least one triangle", 3),
        ("nan.obj", "nan.obj", 3),
        ("index.obj", "index.obj", 3),
        ("open.obj", "open", 3),
    ];
    for (name, message, code) in cases {
        let output = pegfit(folder.path(), &["check", "good.obj", name]);
        assert_eq!(output.status.code(), Some(code), "{name}");
        let text = stdout(&output);
        assert!(text.contains("good.obj: usable"), "{text}");
        assert!(text.contains(&format!("{name}: cannot be used")), "{text}");
        assert!(text.contains(message), "{text}");
        assert!(
            stderr(&output).contains("1 of 2 meshes"),
            "{}",
            stderr(&output)
        );
    }
}

#[test]
fn wrong_usage_exits_with_two() {
    let folder = tempfile::tempdir().unwrap();
    for args in [
        &["check"][..],
        &["chek", "a.obj"],
        &["check", "a.obj", "--unit", "ell"],
        &["check", "a.obj", "--threads", "0"],
    ] {
        let output = pegfit(folder.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(!stderr(&output).is_empty());
    }
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("box.obj"), cuboid_obj([2.0, 3.0, 4.0])).unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder.path())
        .args(["check", "box.obj"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn solids_are_listed_and_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let small = cuboid_obj([1.0, 1.0, 1.0]);
    let large: String = cuboid_obj([4.0, 4.0, 4.0])
        .lines()
        .map(
            |line| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["f", a, b, c] => {
                    let [a, b, c] = [a, b, c].map(|i| i.parse::<u32>().unwrap() + 8);
                    format!("f {a} {b} {c}\n")
                }
                _ => format!("{line}\n"),
            },
        )
        .collect();
    let text = format!("o pin\n{small}o housing\n{large}");
    std::fs::write(folder.path().join("two.obj"), text).unwrap();
    let all = stdout(&pegfit(folder.path(), &["check", "two.obj"]));
    for part in [
        "1, \"pin\", 12 triangles",
        "2, \"housing\", 12 triangles",
        "components   2",
        "welded within",
    ] {
        assert!(all.contains(part), "{part}: {all}");
    }
    let one = pegfit(folder.path(), &["check", "two.obj", "--solid", "housing"]);
    assert!(stdout(&one).contains("64.000000 mm³"), "{}", stdout(&one));
    let none = pegfit(folder.path(), &["check", "two.obj", "--solid", "lid"]);
    assert_eq!(none.status.code(), Some(3));
    assert!(stdout(&none).contains("1 \"pin\", 2 \"housing\""));
}

#[test]
fn what_is_wrong_is_said_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let check = |args: &[&str]| pegfit(folder.path(), &[&["check"], args].concat());
    // Forty metres across: metres taken for millimetres the other way round.
    write("box.obj", &cuboid_obj([20.0, 30.0, 40.0]));
    assert!(stdout(&check(&["box.obj", "--unit", "m"])).contains("say its unit"));
    assert!(!stdout(&check(&["box.obj"])).contains("next"));
    // A box without its lid: an eighth of the area, and more than is tolerated, is missing.
    let text = cuboid_obj([20.0, 30.0, 5.0]);
    let lines: Vec<&str> = text.lines().collect();
    write("open.obj", &lines[..lines.len() - 2].join("\n"));
    let output = check(&["open.obj"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stdout(&output).contains("next") && stdout(&output).contains("close the surface"));
    // Two boxes, one of them elsewhere: through each other, side by side, out of reach.
    for (shift, share, advice) in [(10.0, 0.5, 2), (20.0, 0.0, 0), (200.0, 0.0, 1)] {
        write(
            "s.toml",
            &format!(
                "unit = \"mm\"\nfixed = \"box.obj\"\n[moving]\nmesh = \"box.obj\"\n\
                 name = \"other\"\nposition = [{shift}, 0, 0]\n"
            ),
        );
        let output = check(&["s.toml", "--json"]);
        let said: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        let pair = &said["pairs"][0];
        assert!(
            (pair["share"].as_f64().unwrap() - share).abs() < 1e-6,
            "{pair}"
        );
        assert_eq!(pair["next"].as_array().unwrap().len(), advice, "{pair}");
    }
}

#[test]
fn errors_name_the_next_command() {
    let folder = scene_folder("");
    // Lines are broken to fit a screen.
    let refused = |args: &[&str]| {
        let said = refuse(folder.path(), args);
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = refused(&["dock", "hole.obj"]);
    assert!(said.contains("`pegfit scene hole.obj` makes one"), "{said}");
    let said = refused(&["plot", "well", "none.toml"]);
    assert!(said.contains("-o none.toml` makes a scene"), "{said}");
    assert!(said.contains("unit = \"mm\""), "{said}");
    for args in [
        &["table", "t.zarr"][..],
        &["verify", "t.zarr", "--scene", "scene.toml"],
        &["feel", "scene.toml", "--table", "t.zarr"],
    ] {
        let said = refused(args);
        assert!(said.contains("`pegfit bake SCENE -o t.zarr`"), "{said}");
    }
}
