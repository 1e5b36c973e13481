//! STEP through converters that behave and that do not. The real one runs in the ignored test.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sdf_grid::mesh_io::{self, StepOptions, read_step};
use sdf_grid::{HygieneOptions, LengthUnit, MeshError};

/// A tetrahedron of volume 1/6 as the converter's output, for `cat`.
const TETRAHEDRON: &str = "solid t
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet
facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet
endsolid t
";

/// A shell that takes the file for a script: the last argument is the output.
fn converter(folder: &Path, script: &str) -> (PathBuf, StepOptions) {
    let step = folder.join("part.step");
    let text = format!("for output; do :; done\n{script}\n");
    std::fs::write(&step, text).expect("a new file");
    let options = StepOptions {
        converter: PathBuf::from("sh"),
        ..StepOptions::default()
    };
    (step, options)
}

fn failure(script: &str, change: impl Fn(&mut StepOptions)) -> (String, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (step, mut options) = converter(folder.path(), script);
    change(&mut options);
    match read_step(step, &options, &HygieneOptions::default()) {
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
    let (mesh, report) =
        read_step(step, &options, &HygieneOptions::default()).expect("a tetrahedron");
    assert!(report.watertight);
    assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
}

#[test]
fn a_missing_converter_is_said_with_how_to_install_one() {
    let (expected, found) = failure("", |o| o.converter = PathBuf::from("/no/such/gmsh"));
    assert!(expected.contains("pip install gmsh"), "{expected}");
    assert_eq!(found, "no such program");
}

#[test]
fn a_converter_that_hangs_is_stopped() {
    let start = Instant::now();
    let (expected, _) = failure("exec sleep 60", |o| {
        o.time_limit = Duration::from_millis(200)
    });
    assert_eq!(expected, "an end within 0.2 s");
    assert!(start.elapsed() < Duration::from_secs(30));
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

#[test]
fn an_open_result_is_refused() {
    let first = TETRAHEDRON.find("facet").expect("a facet");
    let second = first + 1 + TETRAHEDRON[first + 1..].find("\nfacet").expect("another");
    let open = format!("{}{}", &TETRAHEDRON[..first], &TETRAHEDRON[second + 1..]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (step, options) = converter(
        folder.path(),
        &format!("cat > \"$output\" <<END\n{open}END"),
    );
    let lenient = HygieneOptions {
        max_open_fraction: 1.0,
        ..HygieneOptions::default()
    };
    let error = read_step(step, &options, &lenient).expect_err("open");
    assert!(
        error
            .to_string()
            .contains("expected closed solids, found 3 open edges"),
        "{error}"
    );
}

#[test]
fn a_missing_step_file_is_named() {
    let options = HygieneOptions::default();
    let error = mesh_io::read("/no/such.stp", LengthUnit::Mm, &options).expect_err("no file");
    assert!(matches!(error, MeshError::Read { .. }));
}

/// A box of 10 x 20 x 30 mm made by Gmsh and read back.
#[test]
#[ignore = "needs gmsh on the PATH: pip install gmsh"]
fn gmsh_converts_with_units() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = folder.path().join("box.geo");
    let text = "SetFactory(\"OpenCASCADE\");\nBox(1) = {0, 0, 0, 10, 20, 30};\n";
    std::fs::write(&script, text).expect("a new file");
    let step = folder.path().join("box.step");
    let status = std::process::Command::new("gmsh")
        .arg(&script)
        .args(["-0", "-o"])
        .arg(&step)
        .status()
        .expect("gmsh runs");
    assert!(status.success());
    let options = HygieneOptions::default();
    let (mesh, report) = mesh_io::read(&step, LengthUnit::M, &options).expect("a box");
    assert_eq!(report.warnings(), Vec::<String>::new());
    // STL holds single precision.
    assert!((mesh.volume() - 6e-6).abs() < 1e-12, "{}", mesh.volume());
}
