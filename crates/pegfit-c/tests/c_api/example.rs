//! The C programs, compiled and run.

use std::path::{Path, PathBuf};
use std::process::Command;

use fft_correlate::{Placement, Pose};
use glam::DVec3;

use crate::table::{bake_placed_spring, bake_spring};

/// The folder with the shared library: where cargo puts this test.
fn library() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().unwrap().to_owned()
}

/// Compiles a C program of this crate with warnings as errors; `None`, said aloud, without a
/// compiler.
fn compile(source: &str, into: &Path) -> Option<PathBuf> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    if Command::new(&compiler).arg("--version").output().is_err() {
        eprintln!(
            "skipped: no C compiler `{compiler}` (apt-get install build-essential, or set CC)"
        );
        return None;
    }
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = into.join("program");
    let library = library();
    let output = Command::new(&compiler)
        .args([
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-I",
        ])
        .arg(here.join("include"))
        .arg(here.join(source))
        .arg("-L")
        .arg(&library)
        .args(["-lpegfit_c", "-lm"])
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .arg("-o")
        .arg(&program)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{source}: {said}");
    Some(program)
}

/// Runs a program on a table and returns what it prints; it must succeed.
fn run(program: &Path, table: &std::ffi::CStr) -> String {
    run_with(program, table, &[])
}

/// The same with more arguments.
fn run_with(program: &Path, table: &std::ffi::CStr, more: &[String]) -> String {
    // A tool such as `valgrind --error-exitcode=9 -q` may look on.
    let mut words = std::env::var("PEGFIT_C_RUNNER").unwrap_or_default();
    words.push(' ');
    words.push_str(program.to_str().unwrap());
    let mut words = words.split_whitespace();
    let output = Command::new(words.next().unwrap())
        .args(words)
        .arg(table.to_str().unwrap())
        .args(more)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {said}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_example_prints_the_well() {
    let folder = tempfile::tempdir().unwrap();
    let table = bake_spring(folder.path());
    let Some(program) = compile("examples/query.c", folder.path()) else {
        return;
    };
    let text = run(&program, &table);
    assert_eq!(text.lines().count(), 6, "{text}");
    // The middle of five is the bottom of the well: no force.
    let bottom = text.lines().nth(3).unwrap();
    assert!(
        bottom.starts_with("z +0.0000 m") && bottom.ends_with("coverage 1.00"),
        "{text}"
    );
    // Force -k z, to half precision of the stored energies.
    let force = |line: usize| -> f64 {
        let words: Vec<&str> = text.lines().nth(line).unwrap().split_whitespace().collect();
        let place = words.iter().position(|w| *w == "force").unwrap();
        words[place + 1].parse().unwrap()
    };
    let z = 0.008 / 3.0;
    assert!(
        (force(2) - crate::table::STIFFNESS * z).abs() < 0.02,
        "{text}"
    );
    assert!(
        (force(4) + crate::table::STIFFNESS * z).abs() < 0.02,
        "{text}"
    );
}

/// The Python example says about the same table what the C example says.
#[test]
fn python_prints_the_same_well() {
    let folder = tempfile::tempdir().unwrap();
    let table = bake_spring(folder.path());
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: no python3 (apt-get install python3)");
        return;
    }
    let Some(program) = compile("examples/query.c", folder.path()) else {
        return;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/query.py");
    let python = |table: &str| {
        let mut command = Command::new("python3");
        command
            .arg(&script)
            .arg(library().join("libpegfit_c.so"))
            .arg(table);
        command.output().unwrap()
    };
    let output = python(table.to_str().unwrap());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let text = String::from_utf8(output.stdout).unwrap();
    let c = run(&program, &table);
    assert_eq!(text.lines().count(), 6, "{text}");
    assert!(text.lines().skip(1).eq(c.lines().skip(1)), "{text}{c}");
    let output = python("nowhere.zarr");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && said.contains("nowhere.zarr"),
        "{said}"
    );
}

/// What Unity and OpenXR feel along their own axes, of a part that a scene moved.
#[test]
fn engines_feel_the_slopes_of_the_energy() {
    let folder = tempfile::tempdir().unwrap();
    let moving = DVec3::new(0.01, -0.02, 0.03);
    let placement = Placement {
        fixed: Pose::IDENTITY,
        moving: Pose::from_translation(moving),
    };
    let table = bake_placed_spring(folder.path(), placement);
    let Some(program) = compile("tests/engine.c", folder.path()) else {
        return;
    };
    let home = (-moving).to_array().map(|x| x.to_string());
    let said = run_with(&program, &table, &home);
    assert_eq!(said.trim(), "slopes and refusals are right");
}

/// Where threads of the parent are gone.
#[test]
fn children_of_a_fork_load_and_query() {
    let folder = tempfile::tempdir().unwrap();
    let table = bake_spring(folder.path());
    let Some(program) = compile("tests/fork.c", folder.path()) else {
        return;
    };
    assert_eq!(run(&program, &table).trim(), "every child answered");
}

#[test]
fn misuse_from_c_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let table = bake_spring(folder.path());
    let Some(program) = compile("tests/misuse.c", folder.path()) else {
        return;
    };
    assert_eq!(run(&program, &table).trim(), "every misuse was refused");
}
