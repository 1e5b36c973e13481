//! The size of this workspace: lines and files of each crate, public names, crates in the command.
//!
//! `just house` prints it; `just house --times` adds the seconds of a clean build and of the tests.

use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use pegfit_structure::{file_length, public_paths, read_crate};

/// Lines and files of product source and of tests, public names at the root and in all modules.
const COUNTED: [&str; 6] = ["product", "files", "tests", "files", "root", "public"];

type Counts = [usize; COUNTED.len()];

fn row(name: &str, cells: [impl ToString; COUNTED.len()]) {
    let cells = cells.map(|cell| format!("{:>8}", cell.to_string()));
    println!("{name:<22}{}", cells.concat());
}

fn add(sum: &mut Counts, counts: Counts) {
    *sum = std::array::from_fn(|n| sum[n] + counts[n]);
}

/// The lines of one file, by its path in its crate; unit tests at its end count as tests.
fn count_file(file: &str, text: &str) -> Counts {
    let lines = text.lines().count();
    let is_test = |name: &str| matches!(name, "tests" | "tests.rs") || name.ends_with("_tests.rs");
    if file.split('/').any(is_test) {
        return [0, 0, lines, 1, 0, 0];
    }
    let product = file_length(text);
    [product, 1, lines - product, 0, 0, 0]
}

/// The public names of a crate; none where it is no library.
fn count_names(folder: &Path) -> Result<Counts, Box<dyn Error>> {
    if !folder.join("src/lib.rs").is_file() {
        return Ok(Counts::default());
    }
    let items = public_paths(&read_crate(&folder.join("src/lib.rs"))?);
    let at_root = |paths: &&BTreeSet<String>| paths.iter().any(|path| !path.contains("::"));
    let root = items.values().filter(at_root).count();
    Ok([0, 0, 0, 0, root, items.len()])
}

/// The lines that a command prints; an error if it fails.
fn output(root: &Path, words: &str) -> Result<Vec<String>, Box<dyn Error>> {
    let (program, rest) = words.split_once(' ').unwrap_or((words, ""));
    let mut command = Command::new(program);
    let done = command.args(rest.split(' ')).current_dir(root).output()?;
    if !done.status.success() {
        return Err(format!("{words}: {}", String::from_utf8_lossy(&done.stderr)).into());
    }
    let text = String::from_utf8(done.stdout)?;
    Ok(text.lines().map(str::to_owned).collect())
}

/// Prints the seconds that a command of `cargo` takes.
fn time(root: &Path, words: &str) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    output(root, &format!("cargo {words} --target-dir target/house"))?;
    println!("cargo {words}: {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = &Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let manifests = output(root, "git ls-files */Cargo.toml")?;
    let folders = manifests.iter().map(|m| m.trim_end_matches("/Cargo.toml"));
    let mut crates: Vec<(&str, Counts)> = folders.map(|f| (f, Counts::default())).collect();
    for file in &output(root, "git ls-files *.rs")? {
        // The innermost crate that holds the file.
        let inside = |folder: &str| file.strip_prefix(folder)?.strip_prefix('/');
        let holders = crates
            .iter_mut()
            .filter_map(|c| Some((inside(c.0)?, &mut c.1)));
        if let Some((within, counts)) = holders.min_by_key(|(within, _)| within.len()) {
            add(
                counts,
                count_file(within, &std::fs::read_to_string(root.join(file))?),
            );
        }
    }
    row("crate", COUNTED);
    let mut sums = [("crates", Counts::default()), ("", Counts::default())];
    for (folder, counts) in &mut crates {
        add(counts, count_names(&root.join(*folder))?);
        row(folder, *counts);
        for (prefix, sum) in &mut sums {
            if folder.starts_with(*prefix) {
                add(sum, *counts);
            }
        }
    }
    row("crates in all", sums[0].1);
    row("all", sums[1].1);
    let tree = output(
        root,
        "cargo tree --locked -p pegfit -e normal --prefix none",
    )?;
    let packages: BTreeSet<&str> = tree.iter().filter_map(|l| l.split(" (").next()).collect();
    println!("crates in the command: {}", packages.len());
    if std::env::args().any(|word| word == "--times") {
        let _ = std::fs::remove_dir_all(root.join("target/house"));
        time(root, "build --release -p pegfit")?;
        time(root, "test --workspace --no-run")?;
        time(root, "test --workspace")?;
        std::fs::remove_dir_all(root.join("target/house"))?;
    }
    Ok(())
}
