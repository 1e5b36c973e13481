//! What the command-line tests share.
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the command in `folder`.
pub(crate) fn pegfit(folder: &Path, args: &[&str]) -> Output {
    pegfit_with_input(folder, args, "")
}

/// Runs the command in `folder` with `input` on standard input.
pub(crate) fn pegfit_with_input(folder: &Path, args: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder)
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_owned();
    // Beside the reading of its output, so that neither waits for the other; a command that reads
    // no input closes the pipe.
    let writing = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().unwrap();
    drop(writing.join().unwrap());
    output
}

/// Standard output as text.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A box of the given sides, centred on the origin, as OBJ.
pub(crate) fn cuboid_obj(sides: [f64; 3]) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |axis: usize| sides[axis] * (f64::from(corner >> axis & 1) - 0.5);
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    // Two triangles per face, counter-clockwise seen from outside.
    for [a, b, c, d] in [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ] {
        text += &format!(
            "f {} {} {}\nf {} {} {}\n",
            a + 1,
            b + 1,
            c + 1,
            a + 1,
            c + 1,
            d + 1
        );
    }
    text
}

/// A folder with the square peg, its hole with 1 mm of clearance, and `scene.toml` for both: so
/// coarse that a field takes a fraction of a second. `extra` is appended to the scene.
pub(crate) fn scene_folder(extra: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = sdf_grid::shapes::PegInHole::Rectangular.pair(1e-3).unwrap();
    sdf_grid::mesh_io::write_obj(folder.path().join("hole.obj"), &hole).unwrap();
    sdf_grid::mesh_io::write_obj(folder.path().join("peg.obj"), &peg).unwrap();
    let scene = format!(
        "unit = \"m\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\n\
         [lattice]\nspacing = 0.0025\nhalo = 0.006\nfield_tolerance = 0.01\n\
         [window]\nhalf_extent = 0.005\n{extra}"
    );
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

/// Runs the command, which must succeed, and returns its standard output.
pub(crate) fn succeed(folder: &Path, args: &[&str]) -> String {
    let output = pegfit(folder, args);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{args:?}: {}",
        stderr(&output)
    );
    stdout(&output)
}

/// Runs the command, which must refuse its input, and returns what it says.
pub(crate) fn refuse(folder: &Path, args: &[&str]) -> String {
    let output = pegfit(folder, args);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{args:?}: {}",
        stderr(&output)
    );
    stderr(&output)
}

/// Changes what a table says of itself, and its digest with it.
pub(crate) fn reseal(table: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let file = table.join("zarr.json");
    let mut group: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    let own = &mut group["attributes"]["pegfit"];
    change(own);
    own.as_object_mut().unwrap().shift_remove("digest");
    let digest = blake3::hash(own.to_string().as_bytes());
    own["digest"] = digest.to_hex().to_string().into();
    std::fs::write(&file, group.to_string()).unwrap();
}

/// The rows of a CSV text as numbers by column; an empty cell is NaN.
pub(crate) fn columns(text: &str) -> Vec<std::collections::HashMap<String, f64>> {
    let mut rows = csv::Reader::from_reader(text.as_bytes());
    let header = rows.headers().unwrap().clone();
    rows.records()
        .map(|row| {
            let row = row.unwrap();
            header
                .iter()
                .zip(&row)
                .map(|(name, cell)| (name.to_owned(), cell.parse().unwrap_or(f64::NAN)))
                .collect()
        })
        .collect()
}

/// The words of a command line, which stand between single spaces.
pub(crate) fn words(text: &str) -> Vec<&str> {
    text.split(' ').collect()
}
