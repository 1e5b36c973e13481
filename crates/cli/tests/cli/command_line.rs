//! What the command says of itself and shows of names, and numbers that are far from sensible ones.

use std::path::Path;
use std::process::Output;

use crate::common::{cuboid_obj, pegfit, refuse, scene_folder, stderr, stdout, succeed, words};

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

/// In contact, apart, and turned.
const POSES: &str = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.001,0,0.002,0,0,0,1\n\
                     0,0.004,0,0.06,0.08,0,0.995\n0,0,0.5,0,0,0,1\n";

const VALUES: [&str; 16] = [
    "1e300", "1e200", "1e100", "1e38", "1e30", "1e20", "1e6", "1e4", "1e-4", "1e-6", "1e-20",
    "1e-38", "1e-300", "0", "-1", "nan",
];

/// The scene's exit code, what it says, and whether every cell of its answers is a finite number.
fn answers(folder: &Path, args: &[&str]) -> (i32, String, bool) {
    let output = pegfit(folder, args);
    let out = stdout(&output);
    let numbers = out.lines().skip(1).flat_map(|line| line.split(','));
    let finite = numbers
        .map(|cell| cell.parse::<f64>())
        .all(|n| n.is_ok_and(f64::is_finite));
    let code = output.status.code().unwrap_or(-1);
    (code, stderr(&output), finite && out.lines().count() == 5)
}

#[test]
fn a_model_beyond_what_can_be_computed_is_refused_by_its_key() {
    let keys = [
        ("model", "lambda_exterior"),
        ("model", "lambda_interior"),
        ("model", "separation_weight"),
        ("model", "sigma"),
        ("energy", "gamma"),
        ("energy", "peak_force"),
    ];
    let (mut refused, mut answered) = (0, 0);
    for (table, key) in keys {
        for value in VALUES {
            let folder = scene_folder(&format!("[{table}]\n{key} = {value}\n"));
            let root = folder.path();
            std::fs::write(root.join("in.csv"), POSES).unwrap();
            let score = ["score", "--scene", "scene.toml", "--poses", "in.csv"];
            let (code, said, finite) = answers(root, &score);
            match code {
                0 => assert!(finite, "{key} = {value}"),
                2 => {
                    assert!(said.contains(key), "{key} = {value}: {said}");
                    assert!(said.contains("found"), "{key} = {value}: {said}");
                }
                _ => panic!("{key} = {value}: {code}: {said}"),
            }
            match code {
                0 => answered += 1,
                _ => refused += 1,
            }
        }
    }
    println!("{refused} refused, {answered} answered with numbers");
    assert!(refused > 40 && answered > 10);
}

/// The largest of everything at once, and the smallest.
#[test]
fn at_the_ends_of_all_ranges_scores_and_tables_are_numbers() {
    let ball = "[rotations]\nkind = \"ball\"\nangle_deg = 10.0\nstep_deg = 10.0\n";
    for (weight, energy) in [
        ("1e4", "gamma = 1e20"),
        ("1e4", "peak_force = 1e9"),
        ("1e-4", "gamma = 1e-20"),
        ("1e-4", "peak_force = 1e-9"),
    ] {
        let folder = scene_folder(&format!(
            "[model]\nlambda_exterior = {weight}\nlambda_interior = {weight}\n\
             separation_weight = 1.0\n[energy]\n{energy}\n{ball}"
        ));
        let root = folder.path();
        std::fs::write(root.join("in.csv"), POSES).unwrap();
        let bake = words("bake scene.toml -o t.zarr --json -q --poses 50");
        let baked = pegfit(root, &bake);
        assert_eq!(baked.status.code(), Some(0), "{energy}: {}", stderr(&baked));
        let summary: serde_json::Value = serde_json::from_str(&stdout(&baked)).unwrap();
        let error = summary["error"]["force"]["rms"].as_f64();
        assert!(
            error.is_some_and(|e| e.is_finite() && e > 0.0),
            "{energy}: {summary}"
        );
        for source in [["--scene", "scene.toml"], ["--table", "t.zarr"]] {
            let args = [&["score"], &source[..], &["--poses", "in.csv"]].concat();
            let (code, said, _) = answers(root, &args);
            assert_eq!(code, 0, "{energy}: {said}");
            let out = stdout(&pegfit(root, &args));
            assert!(
                !out.contains("inf") && !out.contains("NaN"),
                "{energy}: {out}"
            );
        }
    }
}

/// Set to write the page instead of comparing it (`just command-line`).
const DRAW: &str = "PEGFIT_DRAW";

const START: &str = "# The command line\n\nWhat `pegfit --help` and `pegfit COMMAND --help` print; \
                     written by `just command-line`.\n";

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// Names of the commands, from the list that the command prints.
fn commands(help: &str) -> Vec<&str> {
    let list = help.split("Commands:\n").nth(1).unwrap();
    let list = list.split("\n\n").next().unwrap();
    let starts = list
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = starts.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").collect()
}

fn page() -> String {
    let folder = folder();
    let help = |words: &[&str]| succeed(folder.path(), &[words, &["--help"]].concat());
    let fenced = |text: &str| format!("\n```text\n{}\n```\n", text.trim_end());
    let whole = help(&[]);
    let mut page = START.to_owned() + &fenced(&whole);
    for command in commands(&whole) {
        page += &format!("\n## pegfit {command}\n{}", fenced(&help(&[command])));
    }
    page.lines()
        .map(|line| line.trim_end().to_owned() + "\n")
        .collect()
}

#[test]
fn the_page_of_the_command_line_is_what_the_command_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/command-line.md");
    let page = page();
    if std::env::var_os(DRAW).is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap();
    assert!(
        there == page,
        "docs/command-line.md: run `just command-line`"
    );
}

#[test]
fn every_command_has_a_manual_page_and_completions() {
    let folder = folder();
    let help = succeed(folder.path(), &["--help"]);
    succeed(folder.path(), &["man", "."]);
    let bash = succeed(folder.path(), &["completions", "bash"]);
    for command in commands(&help) {
        let page = std::fs::read_to_string(folder.path().join(format!("pegfit-{command}.1")));
        assert!(page.unwrap().contains(".SH SYNOPSIS"), "{command}");
        assert!(bash.contains(&format!("pegfit,{command})")), "{command}");
    }
    assert!(folder.path().join("pegfit.1").is_file());
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(succeed(folder.path(), &["completions", shell]).contains("pegfit"));
    }
    assert!(refuse(folder.path(), &["man", "nowhere"]).contains("an existing folder"));
}

#[test]
fn errors_are_json_for_programs_and_colours_follow_the_option() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["dock", "missing.toml", "--json"];
    let output = pegfit(folder.path(), &args);
    assert_eq!(output.status.code(), Some(2));
    let found: serde_json::Value = serde_json::from_str(&stderr(&output)).unwrap();
    let error = &found["error"];
    assert_eq!(error["exit"], 2);
    assert!(error["help"].as_str().unwrap().contains("pegfit scene"));
    // Wrong usage as well.
    let output = pegfit(folder.path(), &["dock", "--json", "--nothing"]);
    let found: serde_json::Value = serde_json::from_str(&stderr(&output)).unwrap();
    assert!(
        found["error"]["message"]
            .as_str()
            .unwrap()
            .contains("--nothing")
    );
    for (choice, colours) in [("always", true), ("never", false), ("auto", false)] {
        for wrong in [["dock", "missing.toml"], ["dock", "--nothing"]] {
            let args = [&["--color", choice], &wrong[..]].concat();
            let said = stderr(&pegfit(folder.path(), &args));
            assert_eq!(said.contains('\u{1b}'), colours, "{choice}: {said:?}");
        }
    }
}
