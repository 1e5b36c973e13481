//! What the page says about where it was made.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::available_parallelism;

/// Names and values, for the page's first table; what cannot be found out is said to be unknown.
pub(crate) fn facts() -> [(&'static str, String); 7] {
    let unknown = || "unknown".to_owned();
    let cores = available_parallelism().map_or_else(|_| unknown(), |n| n.to_string());
    [
        (
            "processor",
            field("/proc/cpuinfo", "model name").unwrap_or_else(unknown),
        ),
        ("cores in use", cores),
        ("vector instructions", instructions()),
        (
            "memory",
            field("/proc/meminfo", "MemTotal").unwrap_or_else(unknown),
        ),
        ("load average at the end", load().unwrap_or_else(unknown)),
        (
            "compiler",
            output("rustc", &["--version"]).unwrap_or_else(unknown),
        ),
        ("commit", commit().unwrap_or_else(unknown)),
    ]
}

/// The widest set that the kernels use here.
fn instructions() -> String {
    let level = format!("{:?}", fearless_simd::Level::new());
    level.split('(').next().unwrap_or_default().to_owned()
}

/// The value of a `name: value` line.
fn field(file: &str, name: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find(|l| l.starts_with(name))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Of the last 1, 5 and 15 minutes.
fn load() -> Option<String> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    Some(
        text.split_whitespace()
            .take(3)
            .collect::<Vec<_>>()
            .join(", "),
    )
}

/// The commit, and whether sources differ from it.
fn commit() -> Option<String> {
    let hash = output("git", &["rev-parse", "--short=12", "HEAD"])?;
    let sources = ["crates", "benches", "Cargo.toml", "Cargo.lock"];
    let asked: Vec<&str> = ["status", "--porcelain", "--"]
        .into_iter()
        .chain(sources)
        .collect();
    let changed = output("git", &asked)?;
    let note = if changed.is_empty() {
        ""
    } else {
        ", with changes that are not committed"
    };
    Some(format!("{hash}{note}"))
}

/// What a program prints, run in the repository.
fn output(program: &str, words: &[&str]) -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let done = Command::new(program)
        .args(words)
        .current_dir(root)
        .output()
        .ok()?;
    let text = String::from_utf8(done.stdout).ok()?;
    done.status.success().then(|| text.trim().to_owned())
}
