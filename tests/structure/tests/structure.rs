//! The crates of this workspace: no circles of files, dependencies in one direction.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use pegfit_structure::{Graph, arrows, circles, read_crate};

const CRATES: [&str; 6] = [
    "sdf-grid",
    "fft-correlate",
    "haptic",
    "pictures",
    "cli",
    "pegfit-c",
];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn graph(name: &str) -> Graph {
    let root = repository().join("crates").join(name).join("src/lib.rs");
    arrows(&read_crate(&root).unwrap())
}

/// What ties the files of each circle, a line an arrow.
fn described(graph: &Graph) -> String {
    let mut text = String::new();
    for circle in circles(graph) {
        writeln!(text, "circle of {} files", circle.len()).unwrap();
        for from in &circle {
            for (to, names) in graph[from].iter().filter(|(to, _)| circle.contains(to)) {
                let names: Vec<_> = names.iter().map(String::as_str).collect();
                let (from, to) = (from.display(), to.display());
                writeln!(text, "  {from} -> {to}: {}", names.join(", ")).unwrap();
            }
        }
    }
    text
}

/// The folders (or, where there is none, files) right below the source folder.
fn rooms(graph: &Graph) -> Graph {
    let room = |file: &Path| {
        let first = file.components().next().unwrap();
        PathBuf::from(first.as_os_str()).with_extension("")
    };
    let mut rooms = Graph::new();
    for (from, tied) in graph {
        for (to, names) in tied {
            let (from, to) = (room(from), room(to));
            if from != to {
                let kept = rooms.entry(from).or_default().entry(to).or_default();
                kept.extend(names.iter().cloned());
            }
        }
    }
    rooms
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut found = String::new();
    for name in CRATES {
        let text = described(&graph(name));
        if !text.is_empty() {
            writeln!(found, "{name}\n{text}").unwrap();
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn no_folders_import_each_other_in_a_circle() {
    let mut found = String::new();
    for name in CRATES {
        let text = described(&rooms(&graph(name)));
        if !text.is_empty() {
            writeln!(found, "{name}\n{text}").unwrap();
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

/// Of each crate's folder, the package that it is and those of this workspace that it may use.
const DEPENDENCIES: [(&str, &str, &[&str]); 5] = [
    ("sdf-grid", "sdf-grid", &[]),
    ("fft-correlate", "fft-correlate", &["sdf-grid"]),
    ("haptic", "haptic", &["sdf-grid", "fft-correlate"]),
    ("pictures", "pegfit-pictures", &["sdf-grid"]),
    (
        "cli",
        "pegfit",
        &["sdf-grid", "fft-correlate", "haptic", "pegfit-pictures"],
    ),
];

/// `sdf-grid <- fft-correlate <- haptic <- cli`, and `sdf-grid <- pictures <- cli`.
#[test]
fn crates_depend_one_way() {
    let packages: BTreeSet<&str> = DEPENDENCIES.iter().map(|d| d.1).collect();
    for (folder, _, allowed) in DEPENDENCIES {
        let file = repository().join("crates").join(folder).join("Cargo.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        let (_, dependencies) = text.split_once("[dependencies]").unwrap();
        for line in dependencies.lines() {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            let foreign = !packages.contains(name);
            assert!(
                foreign || allowed.contains(&name),
                "{folder} depends on {name}"
            );
        }
    }
}

/// A circle that is there is found, through a re-export and a bare child path; a facade is none.
#[test]
fn a_circle_is_found() {
    let folder = std::env::temp_dir().join(format!("pegfit-structure-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("a")).unwrap();
    let files = [
        (
            "lib.rs",
            "mod a; mod b; pub use a::One; pub use b::{Two as Second};",
        ),
        ("a/mod.rs", "mod one; mod other; pub use one::One;"),
        (
            "a/one.rs",
            "pub struct One; impl One { fn f() { crate::Second::g(); } }",
        ),
        (
            "a/other.rs",
            "use super::One; #[cfg(test)] mod tests { use crate::b::Two; }",
        ),
        (
            "b.rs",
            "pub struct Two(Vec<crate::a::One>); fn h() { vec![1].len(); }",
        ),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let graph = arrows(&read_crate(&folder.join("lib.rs")).unwrap());
    std::fs::remove_dir_all(&folder).unwrap();
    let expected = vec![vec![PathBuf::from("a/one.rs"), PathBuf::from("b.rs")]];
    assert_eq!(circles(&graph), expected, "{graph:?}");
    assert!(graph[Path::new("a/other.rs")].contains_key(Path::new("a/one.rs")));
    assert!(graph[Path::new("a/mod.rs")].is_empty());
}
