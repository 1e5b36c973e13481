//! Names come from whoever made a file: what a terminal would obey is shown, not sent.

use std::path::Path;
use std::process::Output;

use crate::common::{cuboid_obj, pegfit, scene_folder, stderr, stdout};

/// Clears the screen, names the window, and turns the direction of writing.
const EVIL: &str = "x\u{1b}[2J\u{1b}]0;mine\u{7}\u{9b}1m\u{202e}y";

/// As it is shown, and within the quotes of TOML and JSON.
const SHOWN: &str = r"x\u001b[2J\u001b]0;mine\u0007\u009b1m\u202ey";

/// Runs the command in `folder`; what it says must name the evil one and leave a terminal alone.
fn shown(folder: &Path, args: &[&str]) -> Output {
    let output = pegfit(folder, args);
    let said = stdout(&output) + &stderr(&output);
    assert!(said.contains(SHOWN), "{args:?}: {said:?}");
    let obeyed = |c: char| c.is_control() && c != '\n' || c == '\u{202e}';
    assert!(!said.contains(obeyed), "{args:?}: {said:?}");
    output
}

#[test]
#[cfg(unix)]
fn names_of_files_are_shown_not_obeyed() {
    let folder = scene_folder("");
    let (mesh, none) = (format!("{EVIL}.obj"), format!("{EVIL}.toml"));
    std::fs::write(folder.path().join(&mesh), cuboid_obj([2.0, 3.0, 4.0])).unwrap();
    let output = shown(folder.path(), &["check", &mesh, "--unit", "mm"]);
    assert_eq!(output.status.code(), Some(0));
    // Errors with their causes, and lines of the files themselves.
    let output = shown(folder.path(), &["check", &none]);
    assert_eq!(output.status.code(), Some(2));
    std::fs::write(folder.path().join(&none), format!("unit = \"{EVIL}\"\n")).unwrap();
    let output = shown(folder.path(), &["check", &none]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn words_that_are_no_options_are_shown_not_obeyed() {
    let folder = scene_folder("");
    let output = shown(folder.path(), &["check", &format!("--{EVIL}")]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn names_of_parts_are_shown_not_obeyed_and_json_stays_json() {
    let folder = scene_folder("");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "solids.obj",
        &format!("o {EVIL}\n{}", cuboid_obj([2.0, 3.0, 4.0])),
    );
    let list = ["scene", "solids.obj", "--unit", "mm"];
    let output = shown(folder.path(), &list);
    assert_eq!(output.status.code(), Some(0));
    let output = shown(folder.path(), &[&list[..], &["--json"]].concat());
    let said: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert!(said.to_string().contains("mine"));
    // Two parts of one name: a mistake that names it.
    let part = format!("[[fixed]]\nname = \"{SHOWN}\"\nmesh = \"hole.obj\"\n");
    write(
        "twice.toml",
        &format!("unit = \"m\"\nmoving = \"peg.obj\"\n{part}{part}"),
    );
    let output = shown(folder.path(), &["check", "twice.toml"]);
    assert_eq!(output.status.code(), Some(2));
}
