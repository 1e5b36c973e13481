//! `docs/command-line.md` is what the command says of itself; so are manual pages and completions.

use std::path::Path;

use crate::common::{refuse, succeed};

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
