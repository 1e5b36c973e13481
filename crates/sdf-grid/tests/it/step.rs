//! STEP through converters that behave and that do not. The real one runs in the ignored test.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sdf_grid::mesh_io::{self, MeshFile, ReadOptions, StepOptions};
use sdf_grid::{LedgerKind, LengthUnit, MeshError, RepairOptions};

/// A tetrahedron of volume 1/6 as the converter's output, for `cat`.
const TETRAHEDRON: &str = "solid t
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet
endsolid t
";

/// A shell that takes the file for a script: the last argument is the output.
fn converter(folder: &Path, script: &str) -> (PathBuf, ReadOptions) {
    let step = folder.join("part.step");
    let text = format!("for output; do :; done\n{script}\n");
    std::fs::write(&step, text).expect("a new file");
    let options = ReadOptions {
        step: StepOptions {
            converter: Some(PathBuf::from("sh")),
            ..StepOptions::default()
        },
        ..ReadOptions::default()
    };
    (step, options)
}

fn failure(script: &str, change: impl Fn(&mut StepOptions)) -> (String, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (step, mut options) = converter(folder.path(), script);
    change(&mut options.step);
    match mesh_io::read_with(step, &options) {
        Err(MeshError::Converter {
            expected, found, ..
        }) => (expected, found),
        other => panic!("expected the converter to fail, found {other:?}"),
    }
}

#[test]
fn what_the_converter_writes_is_cleaned() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = format!("cat > \"$output\" <<END\n{TETRAHEDRON}END");
    let (step, options) = converter(folder.path(), &script);
    let (mesh, report) = mesh_io::read_with(step, &options).expect("a tetrahedron");
    assert!(report.watertight);
    assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
}

#[test]
fn a_missing_converter_is_said_with_how_to_install_one() {
    let (expected, found) = failure("", |o| o.converter = Some(PathBuf::from("/no/such/gmsh")));
    assert!(expected.contains("pip install gmsh"), "{expected}");
    assert!(found.contains("/no/such/gmsh"), "{found}");
}

#[test]
fn a_converter_that_waits_is_stopped() {
    let start = Instant::now();
    let (expected, _) = failure("exec sleep 60", |o| {
        o.time_limit = Duration::from_millis(20)
    });
    assert_eq!(expected, "an end within 0.02 s of processor time");
    assert!(start.elapsed() < Duration::from_secs(30));
}

#[test]
fn a_converter_that_computes_without_end_is_stopped() {
    // In the process itself, and in one that it waits for.
    for script in [
        "while :; do :; done",
        "sh -c 'while :; do :; done'; exit $?",
    ] {
        let (expected, found) = failure(script, |o| o.time_limit = Duration::from_secs(1));
        assert_eq!(expected, "an end within 1 s of processor time", "{found}");
    }
}

#[test]
fn a_python_without_one_module_is_asked_for_the_other() {
    // A shell in the place of Python: of the module that is asked for depends what it does.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let shell = folder.path().join("python-of-test");
    std::os::unix::fs::symlink("/bin/sh", &shell).expect("a link");
    let step = folder.path().join("part.step");
    std::fs::write(&step, "ISO-10303-21;").expect("a new file");
    let options = ReadOptions {
        step: StepOptions {
            converter: Some(shell),
            ..StepOptions::default()
        },
        ..ReadOptions::default()
    };
    // The shell takes Pegfit's script for one of its own and fails, with either module.
    let error = mesh_io::read_with(&step, &options).expect_err("no Python");
    let message = error.to_string();
    assert!(message.contains("; then"), "{message}");
    assert!(message.contains("python-of-test with OCP"), "{message}");
}

#[test]
fn a_converter_that_fails_is_quoted() {
    let (_, found) = failure("echo cannot open; exit 3", |_| {});
    assert!(
        found.contains("exit status: 3") && found.contains("cannot open"),
        "{found}"
    );
    let (_, found) = failure("echo wrote nothing", |_| {});
    assert!(found.contains("wrote nothing"), "{found}");
}

#[test]
fn the_memory_limit_reaches_the_converter() {
    let (_, found) = failure("ulimit -v; exit 1", |o| o.memory_limit = 123 << 20);
    assert!(found.contains("125952"), "{found}");
}

/// A shell that takes about 300 MB for a variable.
const HUNGRY: &str = "x=$(head -c 100000000 /dev/zero | tr '\\0' a); echo ${#x}; exit 3";

#[test]
fn a_converter_that_takes_too_much_memory_ends() {
    let (_, found) = failure(HUNGRY, |o| o.memory_limit = 4 << 30);
    assert!(found.contains("100000000"), "enough memory: {found}");
    let (_, found) = failure(HUNGRY, |o| o.memory_limit = 64 << 20);
    assert!(!found.contains("100000000"), "too little: {found}");
}

#[test]
fn a_converter_that_fills_the_disk_ends() {
    let script = "head -c 40000000 /dev/zero > \"$output\" || exit 4; exit 5";
    let (_, found) = failure(script, |o| o.memory_limit = 64 << 20);
    assert!(found.contains("exit status: 5"), "enough room: {found}");
    let (_, found) = failure(script, |o| o.memory_limit = 32 << 20);
    assert!(found.contains("exit status: 4"), "too little: {found}");
}

#[test]
fn what_a_converter_started_is_stopped_with_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mark = folder.path().join("still-alive");
    let script = format!("(sleep 1; touch {}) & sleep 60", mark.display());
    failure(&script, |o| o.time_limit = Duration::from_millis(20));
    std::thread::sleep(Duration::from_millis(1500));
    assert!(!mark.exists());
}

#[test]
fn solids_keep_their_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let second = TETRAHEDRON
        .replace("solid t", "solid big shaft")
        .replace(" 1", " 2");
    let script = format!("cat > \"$output\" <<END\n{TETRAHEDRON}{second}END");
    let (step, mut options) = converter(folder.path(), &script);
    let file = MeshFile::open(&step, &options.step).expect("two tetrahedra");
    let names: Vec<_> = file.solids().into_iter().map(|s| s.name).collect();
    assert_eq!(names, ["t", "big shaft"]);
    for (wanted, volume) in [("t", 1.0 / 6.0), ("big shaft", 8.0 / 6.0), ("2", 8.0 / 6.0)] {
        options.solid = Some(wanted.to_owned());
        let (mesh, _) = mesh_io::read_with(&step, &options).expect(wanted);
        assert!((mesh.volume() - volume).abs() < 1e-12, "{wanted}");
    }
    options.solid = Some("3".to_owned());
    let error = mesh_io::read_with(&step, &options).expect_err("no third");
    assert!(error.to_string().contains("2 \"big shaft\""), "{error}");
}

#[test]
fn an_open_result_is_refused() {
    let first = TETRAHEDRON.find("facet").expect("a facet");
    let second = first + 1 + TETRAHEDRON[first + 1..].find("\nfacet").expect("another");
    let open = format!("{}{}", &TETRAHEDRON[..first], &TETRAHEDRON[second + 1..]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (step, mut options) = converter(
        folder.path(),
        &format!("cat > \"$output\" <<END\n{open}END"),
    );
    options.repair.max_open_fraction = 1.0;
    let error = mesh_io::read_with(step, &options).expect_err("open");
    assert!(
        error
            .to_string()
            .contains("expected closed solids, found 3 open edges"),
        "{error}"
    );
}

#[test]
fn a_missing_step_file_is_named() {
    let options = RepairOptions::default();
    let error = mesh_io::read("/no/such.stp", LengthUnit::Mm, &options).expect_err("no file");
    assert!(matches!(error, MeshError::Read { .. }));
}

/// What Gmsh's Python module writes, as a STEP file.
fn made_by_gmsh(folder: &Path, shapes: &str) -> PathBuf {
    let step = folder.join("made.step");
    let script = format!(
        "import gmsh; gmsh.initialize(); o = gmsh.model.occ\n{shapes}\no.synchronize()\n\
         gmsh.write({step:?})"
    );
    let status = std::process::Command::new("python3")
        .args(["-c", &script])
        .status()
        .expect("python3 runs");
    assert!(status.success());
    step
}

/// Faces beside solids are listed, a file of faces alone is refused as such, and a cone's tip takes
/// no longer than anything else.
#[test]
#[ignore = "needs python3 with the module gmsh: pip install gmsh"]
fn gmsh_tells_solids_from_faces_and_cuts_tips_no_finer_than_needed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let shapes = "o.addCone(0,0,0,0,0,8,10,0); o.addDisk(90,0,0,5,5)";
    let step = made_by_gmsh(folder.path(), shapes);
    let found = mesh_io::examine(&step, &ReadOptions::default()).expect("a cone");
    let volume = std::f64::consts::PI * 100.0 * 8.0 / 3.0 * 1e-9;
    assert!((found.report.volume / volume - 1.0).abs() < 0.01);
    assert_eq!(found.report.flipped_faces, 0);
    assert!(
        found.report.triangles < 50_000,
        "{}",
        found.report.triangles
    );
    let ignored: Vec<_> = found.ledger.of_kind(LedgerKind::Ignored).collect();
    assert_eq!((ignored[0].item.as_str(), ignored[0].count), ("face", 1));
    let step = made_by_gmsh(folder.path(), "o.addDisk(90,0,0,5,5)");
    let error = mesh_io::examine(&step, &ReadOptions::default()).expect_err("a disk");
    assert!(matches!(error, MeshError::NoSolid { .. }), "{error}");
}

/// A box of 10 x 20 x 30 mm and a cylinder of radius 5 and height 25 mm made by Gmsh's Python
/// module and read back, by name where the converter tells names.
#[test]
#[ignore = "needs python3 with the module gmsh: pip install gmsh"]
fn gmsh_converts_with_units_and_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let step = folder.path().join("two.step");
    let script = format!(
        "import gmsh; gmsh.initialize(); o = gmsh.model.occ\n\
         o.addBox(0,0,0,10,20,30); o.addCylinder(30,0,0,0,0,25,5); o.synchronize()\n\
         gmsh.write({step:?})"
    );
    let status = std::process::Command::new("python3")
        .args(["-c", &script])
        .status()
        .expect("python3 runs");
    assert!(status.success());
    let text = std::fs::read_to_string(&step).expect("a STEP file");
    // Open CASCADE numbers the products of an assembly.
    let text = text
        .replace(" 1.1'", " housing'")
        .replace(" 1.2'", " shaft'");
    std::fs::write(&step, text).expect("written");
    let file = MeshFile::open(&step, &StepOptions::default()).expect("two solids");
    let names: Vec<_> = file.solids().into_iter().map(|s| s.name).collect();
    assert!(names.len() == 2 && names[0].ends_with("housing") && names[1].ends_with("shaft"));
    let cylinder = std::f64::consts::PI * 25.0 * 25e-9;
    for (wanted, volume) in [(&names[0], 6e-6), (&names[1], cylinder)] {
        let options = ReadOptions {
            solid: Some(wanted.clone()),
            ..ReadOptions::default()
        };
        let (mesh, report) = mesh_io::read_with(&step, &options).expect("a solid");
        assert_eq!(report.warnings(), Vec::<String>::new());
        // 64 edges around the cylinder: its polygon lacks 0.16 % of the circle.
        let lacking = 1.0 - mesh.volume() / volume;
        assert!((-1e-9..2e-3).contains(&lacking), "{wanted}: {lacking}");
    }
}
