//! The crates of this workspace: no circles of files, dependencies in one direction.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use pegfit_structure::{Graph, arrows, circles, file_length, flow_chart, public_paths, read_crate};

const CRATES: [&str; 12] = [
    "sdf-grid",
    "fft-correlate",
    "haptic",
    "scene",
    "path",
    "play",
    "play-wasm",
    "pictures",
    "cli",
    "pegfit-c",
    "pegfit-python",
    "fixtures",
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
const DEPENDENCIES: [(&str, &str, &[&str]); 10] = [
    ("sdf-grid", "sdf-grid", &[]),
    ("fft-correlate", "fft-correlate", &["sdf-grid"]),
    ("haptic", "haptic", &["sdf-grid", "fft-correlate"]),
    (
        "scene",
        "pegfit-scene",
        &["sdf-grid", "fft-correlate", "haptic"],
    ),
    ("path", "pegfit-path", &["sdf-grid", "fft-correlate"]),
    (
        "assemble",
        "pegfit-assemble",
        &["sdf-grid", "fft-correlate", "pegfit-path"],
    ),
    (
        "play",
        "pegfit-play",
        &[
            "sdf-grid",
            "fft-correlate",
            "haptic",
            "pegfit-scene",
            "pegfit-pictures",
        ],
    ),
    (
        "play-wasm",
        "pegfit-play-wasm",
        &[
            "sdf-grid",
            "fft-correlate",
            "haptic",
            "pegfit-scene",
            "pegfit-play",
        ],
    ),
    ("pictures", "pegfit-pictures", &["sdf-grid"]),
    (
        "cli",
        "pegfit",
        &[
            "sdf-grid",
            "fft-correlate",
            "haptic",
            "pegfit-scene",
            "pegfit-path",
            "pegfit-assemble",
            "pegfit-play",
            "pegfit-pictures",
        ],
    ),
];

/// `sdf-grid <- fft-correlate <- haptic <- scene <- cli`, `scene <- play <- cli`,
/// `fft-correlate <- path <- assemble <- cli`, and `sdf-grid <- pictures <- play`.
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

/// Crates that others name things of.
const LIBRARIES: [&str; 5] = ["sdf-grid", "fft-correlate", "haptic", "scene", "pictures"];

#[test]
fn one_public_path_per_name() {
    let mut found = String::new();
    for name in LIBRARIES {
        let root = repository().join("crates").join(name).join("src/lib.rs");
        let items = public_paths(&read_crate(&root).unwrap());
        assert!(items.len() > 20, "{name}: {} public items", items.len());
        let mut types: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (item, paths) in &items {
            let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
            if paths.len() > 1 {
                writeln!(found, "{name}: one item, {}", paths.join(" and ")).unwrap();
            }
            if item.is_type {
                types.entry(&item.name).or_default().push(paths[0]);
            }
        }
        for paths in types.values().filter(|paths| paths.len() > 1) {
            writeln!(found, "{name}: one name, {}", paths.join(" and ")).unwrap();
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

/// What two names and two types of one name look like.
#[test]
fn a_second_path_is_found() {
    let folder = made_up("paths");
    let files = [
        (
            "lib.rs",
            "pub mod a; mod b; pub use a::One; pub use b::{Two, one}; pub(crate) use a::f;",
        ),
        (
            "a.rs",
            "pub struct One; pub const fn f() {} struct Hidden; pub use crate::b::Three as Two;",
        ),
        (
            "b.rs",
            "pub struct Two; pub struct Three; pub unsafe fn one() {}",
        ),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let items = public_paths(&read_crate(&folder.join("lib.rs")).unwrap());
    std::fs::remove_dir_all(&folder).unwrap();
    let paths = |name: &str| {
        let (item, paths) = items.iter().find(|(item, _)| item.name == name).unwrap();
        (
            item.is_type,
            paths.iter().map(String::as_str).collect::<Vec<_>>(),
        )
    };
    assert_eq!(items.len(), 5, "{items:?}");
    assert_eq!(paths("One"), (true, vec!["One", "a::One"]));
    assert_eq!(paths("f"), (false, vec!["a::f"]));
    assert_eq!(paths("one"), (false, vec!["one"]));
    assert_eq!(paths("Two"), (true, vec!["Two"]));
    assert_eq!(paths("Three"), (true, vec!["a::Two"]));
}

/// Most lines of a file; clippy counts those of functions.
const LONGEST: usize = 800;

#[test]
fn files_are_short() {
    let mut found = String::new();
    let files = sources(&repository().join("crates"));
    assert!(files.len() > 100, "{} files", files.len());
    for file in files {
        let length = file_length(&std::fs::read_to_string(&file).unwrap());
        if length > LONGEST {
            writeln!(found, "{}: {length} lines", file.display()).unwrap();
        }
    }
    assert!(found.is_empty(), "\n{found}");
}

/// The source files of all crates but those of unit tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let test = name == "tests" || name == "tests.rs" || name.ends_with("_tests.rs");
        if path.is_dir() && !test {
            found.extend(sources(&path));
        } else if name.ends_with(".rs") && !test {
            found.push(path);
        }
    }
    found
}

#[test]
fn unit_tests_at_the_end_of_a_file_do_not_count() {
    let text = "fn a() {\n}\n#[cfg(test)]\nmod tests {\n    fn d() {\n    }\n}\n";
    assert_eq!(file_length(text), 2);
}

/// A new folder for made-up source.
fn made_up(name: &str) -> PathBuf {
    let name = format!("pegfit-structure-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A circle that is there is found, through a re-export and a bare child path; a facade is none.
#[test]
fn a_circle_is_found() {
    let folder = made_up("circles");
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

/// `just modules` draws it again.
#[test]
fn the_picture_of_the_modules_is_that_of_the_source() {
    const BEGIN: &str = "<!-- drawn by `just modules` -->\n";
    const END: &str = "<!-- end of the drawing -->\n";
    let crates: Vec<_> = DEPENDENCIES
        .iter()
        .map(|&(folder, _, uses)| {
            let uses: Vec<&str> = uses
                .iter()
                .map(|u| DEPENDENCIES.iter().find(|d| d.1 == *u).unwrap().0)
                .collect();
            (folder, uses, rooms(&graph(folder)))
        })
        .collect();
    let crates: Vec<_> = crates
        .iter()
        .map(|(folder, uses, rooms)| (*folder, &uses[..], rooms.clone()))
        .collect();
    let drawn = flow_chart(&crates);
    let page = repository().join("docs/architecture.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (before, rest) = text.split_once(BEGIN).unwrap();
    let (found, after) = rest.split_once(END).unwrap();
    if std::env::var_os("PEGFIT_DRAW").is_some() {
        std::fs::write(&page, format!("{before}{BEGIN}{drawn}{END}{after}")).unwrap();
    } else {
        assert_eq!(found, drawn, "run `just modules`");
    }
}
