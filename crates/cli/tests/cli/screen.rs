//! `pegfit screen` from the outside.

use std::path::Path;

use glam::{DQuat, DVec3};
use sdf_grid::mesh_io;
use sdf_grid::shapes::PegInHole;

use crate::common::{cuboid_obj, pegfit, refuse, stderr, succeed, words};

/// A hole, and a library with its peg (turned, in a folder of its own), a cuboid that is too large for
/// it, and a file that is none.
pub(crate) fn library_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("library");
    std::fs::create_dir_all(library.join("pegs")).unwrap();
    let (hole, peg) = PegInHole::Rectangular.pair(2e-4).unwrap();
    let turned = peg.transformed(DQuat::from_rotation_x(1.1), DVec3::new(0.2, 0.1, 0.0));
    mesh_io::write_obj(folder.path().join("hole.obj"), &hole).unwrap();
    mesh_io::write_obj(library.join("pegs/peg.obj"), &turned).unwrap();
    let large = 1.1 * peg.bounds().size();
    std::fs::write(library.join("cube.obj"), cuboid_obj([large.x; 3])).unwrap();
    std::fs::write(library.join("broken.stl"), "solid nothing at all").unwrap();
    std::fs::write(library.join("notes.txt"), "no part").unwrap();
    folder
}

fn table(file: &Path) -> Vec<std::collections::HashMap<String, String>> {
    let mut rows = csv::Reader::from_path(file).unwrap();
    rows.deserialize().map(Result::unwrap).collect()
}

/// Without what a clock decides.
fn untimed(file: &Path) -> Vec<std::collections::HashMap<String, String>> {
    let mut rows = table(file);
    rows.iter_mut().for_each(|row| drop(row.remove("seconds")));
    rows
}

/// The peg is the best part, at home in its hole; a file that is none is a row.
#[test]
fn the_part_that_fits_comes_first_and_a_broken_file_is_a_row() {
    let folder = library_folder();
    let line = "screen hole.obj --library library --unit m -o fits.csv --json -q";
    let said = succeed(folder.path(), &words(line));
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(
        (&summary["files"], &summary["failed"]),
        (&3.into(), &1.into())
    );
    assert_eq!(
        (&summary["complete"], &summary["held"]),
        (&true.into(), &1.into())
    );
    let rows = table(&folder.path().join("fits.csv"));
    let files: Vec<&str> = rows.iter().map(|r| r["file"].as_str()).collect();
    assert_eq!(files, ["pegs/peg.obj", "cube.obj", "broken.stl"]);
    let number = |row: usize, key: &str| rows[row][key].parse::<f64>().unwrap();
    assert!(number(0, "quality") > 0.3, "{said}");
    assert!(
        number(0, "quality") > 2.0 * number(1, "quality").max(0.1),
        "{said}"
    );
    assert!(
        number(0, "hold") > 8.0 && number(0, "overlap") < 1e-3,
        "{said}"
    );
    assert_eq!(
        (rows[0]["part"].as_str(), rows[0]["error"].as_str()),
        ("peg", "")
    );
    assert!(!rows[0]["joint"].is_empty() && number(0, "seconds") > 0.0);
    // Its axis is again that of the hole: the turn of the file is undone.
    let turn = DQuat::from_xyzw(
        number(0, "qx"),
        number(0, "qy"),
        number(0, "qz"),
        number(0, "qw"),
    );
    let axis = turn * DQuat::from_rotation_x(1.1) * DVec3::Z;
    assert!(axis.z.abs() > 0.999, "{axis}");
    assert!(rows[2]["error"].contains("broken.stl") && rows[2]["x"].is_empty());
}

/// Whoever finds the last row missing writes the table; what was there is kept.
#[test]
fn ranks_share_a_library_and_a_run_resumes() {
    let folder = library_folder();
    let root = folder.path();
    let all = "screen hole.obj --library library --unit m -o all.csv --json -q";
    succeed(root, &words(all));
    let run = |more: &str| {
        let line = format!("screen hole.obj --library library --unit m -o t.csv --json -q {more}");
        let said = succeed(root, &words(&line));
        serde_json::from_str::<serde_json::Value>(&said).unwrap()
    };
    let first = run("--rank 0 --size 2");
    assert_eq!(
        (&first["finished"], &first["complete"]),
        (&2.into(), &false.into())
    );
    assert!(!root.join("t.csv").exists());
    assert_eq!(run("--status")["finished"], 2);
    let second = run("--rank 1 --size 2");
    assert_eq!(
        (&second["screened"], &second["complete"]),
        (&1.into(), &true.into())
    );
    assert_eq!(untimed(&root.join("t.csv")), untimed(&root.join("all.csv")));

    // Rows of other options, of a changed file, and half ones do not count.
    let said = refuse(root, &words(&all.replace("all.csv", "t.csv")));
    assert!(
        said.contains("t.csv.rows") && said.contains("--resume"),
        "{said}"
    );
    assert_eq!(run("--resume")["screened"], 0);
    std::fs::write(root.join("library/cube.obj"), cuboid_obj([0.05; 3])).unwrap();
    assert_eq!(run("--resume")["screened"], 1);
    assert_eq!(run("--resume --mating-clearance 0.0001")["screened"], 3);
}

#[test]
fn what_cannot_be_screened_is_refused() {
    let folder = library_folder();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let cases = [
        ("screen hole.obj", "--library"),
        (
            "screen hole.obj --library empty",
            "files that end with obj, stl",
        ),
        ("screen hole.obj --library nowhere", "nowhere"),
        ("screen nothing.obj --library library", "nothing.obj"),
        ("screen library/broken.stl --library library", "broken.stl"),
        (
            "screen hole.obj --library library --rank 2 --size 2",
            "below --size 2",
        ),
        (
            "screen hole.obj --library library --mating-clearance=-1",
            "a positive length",
        ),
        (
            "screen hole.obj --library library -o no/fits.csv",
            "an existing folder",
        ),
    ];
    for (line, expected) in cases {
        let said = refuse(folder.path(), &words(line));
        assert!(said.contains(expected), "{line}: {said}");
    }
    let output = pegfit(
        folder.path(),
        &words("screen hole.obj --library library -o t.parquet --unit m"),
    );
    match cfg!(feature = "parquet") {
        true => assert!(
            folder.path().join("t.parquet").exists(),
            "{}",
            stderr(&output)
        ),
        false => assert!(stderr(&output).contains("--features parquet")),
    }
}
