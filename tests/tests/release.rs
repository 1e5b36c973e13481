//! One version, and crates that say and hold what a registry asks for.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).expect(path)
}

/// The text between the first `before` and the next quotation mark.
fn quoted<'a>(text: &'a str, before: &str) -> &'a str {
    let rest = text.split(before).nth(1).expect(before);
    rest.split('"').next().expect("a quotation mark")
}

/// Folders of the workspace's members.
fn members() -> Vec<String> {
    let manifest = read("Cargo.toml");
    let list = manifest.split("\nmembers = [").nth(1).expect("members");
    let list = list.split(']').next().expect("a list");
    let names = list.split(',').map(|name| name.trim().trim_matches('"'));
    names.map(str::to_owned).collect()
}

#[test]
fn there_is_one_version() {
    let manifest = read("Cargo.toml");
    let version = quoted(&manifest, "[workspace.package]\nversion = \"");
    let mut crates = 0;
    for line in manifest.lines().filter(|line| line.contains("{ path = \"")) {
        assert_eq!(quoted(line, "version = \""), version, "{line}");
        crates += 1;
    }
    assert!(crates > 5, "{crates}");
    for member in members() {
        let text = read(&format!("{member}/Cargo.toml"));
        assert!(text.contains("version.workspace = true"), "{member}");
    }
    assert!(read("CITATION.cff").contains(&format!("\nversion: {version}\n")));
    assert!(read("pyproject.toml").contains("dynamic = [\"version\"]"));
}

#[test]
fn what_is_published_says_what_it_is() {
    let mut published = 0;
    for member in members() {
        let text = read(&format!("{member}/Cargo.toml"));
        if text.contains("publish = false") {
            continue;
        }
        published += 1;
        assert!(quoted(&text, "description = \"").len() > 20, "{member}");
        for key in [
            "license",
            "repository",
            "readme",
            "keywords",
            "categories",
            "rust-version",
        ] {
            assert!(
                text.contains(&format!("{key}.workspace = true")),
                "{member}: {key}"
            );
        }
    }
    assert_eq!(published, 10, "crates that are published");
    let others = [
        "crates/fixtures",
        "crates/play-wasm",
        "benches",
        "tests",
        "tests/structure",
        "tests/truth",
        "tests/hid-vm",
    ];
    for other in others {
        assert!(
            read(&format!("{other}/Cargo.toml")).contains("publish = false"),
            "{other}"
        );
    }
}

/// Registries show this page under addresses of their own: its links name the repository.
#[test]
fn the_page_of_the_packages_has_whole_links() {
    let manifest = read("Cargo.toml");
    let name = quoted(&manifest, "\nreadme = \"");
    assert_eq!(quoted(&read("pyproject.toml"), "\nreadme = \""), name);
    let page = read(name);
    let links: Vec<&str> = page.split("](").skip(1).collect();
    assert!(links.len() > 8, "{}", links.len());
    for link in links {
        assert!(link.starts_with("https://"), "{name}: {link}");
    }
}

/// A package holds what lies beside its manifest, so each crate links to our licences.
#[test]
fn packages_hold_both_licences() {
    let crates = members().into_iter().filter(|m| m.starts_with("crates/"));
    for member in crates {
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            assert_eq!(read(&format!("{member}/{name}")), read(name), "{member}");
        }
    }
}

/// The oldest Rust that compiles this; `.ci/run` holds the manifest to it.
#[test]
fn pages_name_the_rust_that_the_manifest_asks_for() {
    let manifest = read("Cargo.toml");
    let version = quoted(&manifest, "\nrust-version = \"");
    for (page, words) in [
        ("README.md", "Rust {}"),
        ("docs/install.md", "Rust {}"),
        ("docs/python.md", "a Rust toolchain ({})"),
    ] {
        let words = words.replace("{}", version);
        assert!(read(page).contains(&words), "{page}: {words}");
    }
}
