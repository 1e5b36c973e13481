//! The pages of the repository: lines that fit a screen, links that lead somewhere.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Longest line of a page, characters. Rows of tables are exempt: Markdown cannot break them.
const WIDTH: usize = 100;

/// Phrases that pages in plain English do without (CONTRIBUTING.md).
const REFUSED: [&str; 6] = [
    "is told",
    "are told",
    "is said",
    "is looked for",
    "ways in",
    "what of",
];

/// Pages below `docs` that programs write.
const GENERATED: [&str; 4] = [
    "command-line.md",
    "comparison.md",
    "contact-measured.md",
    "report.md",
];

/// Folders that hold no pages of ours.
const SKIPPED: [&str; 5] = ["target", "out", "corpus", "node_modules", "pegfit-demo"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every Markdown file below a folder, hidden folders left out.
fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if name.starts_with('.') || SKIPPED.contains(&name.as_ref()) {
            continue;
        }
        // Not `path.is_dir()`, which follows links out of the repository.
        if entry.file_type().is_ok_and(|t| t.is_dir()) {
            collect(&path, found);
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

fn pages() -> Vec<(PathBuf, String)> {
    let mut paths = Vec::new();
    collect(&root(), &mut paths);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a page");
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

/// Lines with their numbers that are not code, with spans of code blanked.
fn prose(text: &str) -> Vec<(usize, String)> {
    let (mut fenced, mut kept) = (false, Vec::new());
    for (number, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced && !line.starts_with("    ") {
            let outside = line.split('`').step_by(2);
            kept.push((number + 1, outside.collect::<Vec<_>>().join("``")));
        }
    }
    kept
}

/// Targets of `[words](target)` with the number of the line where the target stands.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in prose(text) {
        for part in line.split("](").skip(1) {
            if let Some((target, _)) = part.split_once(')') {
                found.push((number, target.to_owned()));
            }
        }
    }
    found
}

/// The anchors that GitHub gives the headings of a page.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut fenced = false;
    let mut headings = Vec::new();
    for line in text.lines() {
        fenced ^= line.starts_with("```");
        if !fenced && line.starts_with('#') {
            headings.push(line.trim_start_matches('#').trim());
        }
    }
    let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    let slug = |heading: &&str| -> String {
        let small = heading.to_lowercase();
        small
            .chars()
            .filter(kept)
            .collect::<String>()
            .replace(' ', "-")
    };
    headings.iter().map(slug).collect()
}

/// Where pages that are shown elsewhere than in the repository point into it.
const ELSEWHERE: [&str; 2] = [
    "https://github.com/pegfit/pegfit/blob/main/",
    "https://raw.githubusercontent.com/pegfit/pegfit/main/",
];

/// What is wrong with one link from a page, if anything.
fn broken(page: &Path, target: &str) -> Option<String> {
    let ours = ELSEWHERE
        .iter()
        .find_map(|start| target.strip_prefix(start));
    if let Some(ours) = ours {
        return broken(&root().join("README.md"), ours);
    }
    if ["http://", "https://", "mailto:"]
        .iter()
        .any(|s| target.starts_with(s))
    {
        return None;
    }
    let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
    let path = match file {
        "" => page.to_owned(),
        _ => page.parent().expect("a folder").join(file),
    };
    if !path.exists() {
        return Some(format!("{target}: no such file"));
    }
    if anchor.is_empty() {
        return None;
    }
    let text = fs::read_to_string(&path).unwrap_or_default();
    let known = anchors(&text);
    (!known.contains(anchor)).then(|| format!("{target}: no such heading; known: {known:?}"))
}

#[test]
fn lines_of_pages_are_at_most_100_characters() {
    let pages = pages();
    assert!(pages.len() > 10, "pages were found");
    let mut long = Vec::new();
    for (path, text) in &pages {
        for (number, line) in text.lines().enumerate() {
            let length = line.chars().count();
            if length > WIDTH && !line.starts_with('|') {
                long.push(format!(
                    "{}:{}: {length} characters",
                    path.display(),
                    number + 1
                ));
            }
        }
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
}

/// Refused phrases with the numbers of their lines. Parts that programs write, between marks, and
/// code are exempt.
fn refused(text: &str) -> Vec<(usize, &'static str)> {
    let (mut generated, mut found) = (false, Vec::new());
    for (number, line) in prose(text) {
        generated |= line.starts_with("<!-- begin:");
        generated &= !line.starts_with("<!-- end:");
        let line = line.to_lowercase();
        if !generated {
            let phrases = REFUSED.into_iter().filter(|phrase| line.contains(phrase));
            found.extend(phrases.map(|phrase| (number, phrase)));
        }
    }
    found
}

#[test]
fn pages_are_in_plain_english() {
    let mut wrong = Vec::new();
    for (path, text) in pages() {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !path.starts_with(root().join("docs")) || GENERATED.contains(&name.as_ref()) {
            continue;
        }
        for (number, phrase) in refused(&text) {
            wrong.push(format!("{}:{number}: \"{phrase}\"", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn links_of_pages_lead_somewhere() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for (path, text) in pages() {
        for (number, target) in links(&text) {
            count += 1;
            if let Some(what) = broken(&path, &target) {
                wrong.push(format!("{}:{number}: {what}", path.display()));
            }
        }
    }
    assert!(count > 50, "links were found: {count}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Words of links that name a file where its title would say more, with their lines.
fn named_by_file(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in prose(text) {
        for part in line.split("](").collect::<Vec<_>>().windows(2) {
            let words = part[0].rsplit('[').next().unwrap_or_default();
            if words.ends_with(".md") && part[1].contains(".md") {
                found.push((number, words.to_owned()));
            }
        }
    }
    found
}

#[test]
fn links_are_titles() {
    let mut wrong = Vec::new();
    for (path, text) in pages() {
        // On GitHub these two are known by their names.
        let usual = ["CONTRIBUTING.md", "SECURITY.md"];
        for (number, words) in named_by_file(&text) {
            if !usual.contains(&words.as_str()) {
                wrong.push(format!("{}:{number}: [{words}]", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn pictures_beside_the_pages_are_shown_by_one() {
    let mut shown = BTreeSet::new();
    for (path, text) in pages() {
        let folder = path.parent().expect("a folder").to_owned();
        let there = |(_, target): (usize, String)| folder.join(target).canonicalize().ok();
        shown.extend(links(&text).into_iter().filter_map(there));
    }
    for entry in fs::read_dir(root().join("docs/figures"))
        .expect("a folder")
        .flatten()
    {
        let path = entry.path().canonicalize().expect("a file");
        assert!(shown.contains(&path), "no page shows {}", path.display());
    }
}

/// `just figures` makes them, or `just report`.
#[test]
fn every_picture_is_made_by_a_command() {
    let recipes = fs::read_to_string(root().join("justfile")).expect("justfile");
    let (_, recipe) = recipes.split_once("\nfigures:\n").expect("a recipe");
    let recipe = recipe.split("\n\n").next().expect("its lines");
    let words: BTreeSet<&str> = recipe.split(&[' ', '/', ';', '\n'][..]).collect();
    for entry in fs::read_dir(root().join("docs/figures"))
        .expect("a folder")
        .flatten()
    {
        let file = entry.file_name().to_string_lossy().into_owned();
        let made = file.starts_with("report-")
            || words.contains(file.as_str())
            || words.contains(file.trim_end_matches(".png"));
        assert!(made, "nothing makes docs/figures/{file}");
    }
}

#[test]
fn the_checks_see_what_is_wrong() {
    let text =
        "# One `two` & three\n[a](b.md#c) `[no](link)`\n    [code](x)\n```\n# [no](y)\n```\n";
    assert_eq!(links(text), [(2, "b.md#c".to_owned())]);
    assert_eq!(anchors(text), BTreeSet::from(["one-two--three".to_owned()]));
    let said = "It is told.\n```\nis told\n```\n<!-- begin: x -->\nis said\n<!-- end: x -->\nWhat of it?\n";
    assert_eq!(refused(said), [(1, "is told"), (8, "what of")]);
    let linked = "[One](a.md) [a.md](a.md#b)\n`[c.md](d.md)` [d.md](https://e.org)\n";
    assert_eq!(named_by_file(linked), [(1, "a.md".to_owned())]);
    let page = root().join("README.md");
    assert!(broken(&page, "docs/no-such-page.md").is_some());
    assert!(broken(&page, "docs/accuracy.md#no-such-heading").is_some());
    assert!(broken(&page, "docs/accuracy.md#known-limits").is_none());
    assert!(broken(&page, "https://example.org/anything").is_none());
    for (page_there, is_broken) in [("accuracy.md#known-limits", false), ("none.md", true)] {
        let whole = format!("{}docs/{page_there}", ELSEWHERE[0]);
        assert_eq!(broken(&page, &whole).is_some(), is_broken, "{whole}");
    }
}
