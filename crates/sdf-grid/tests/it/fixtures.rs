//! The files in `fixtures/` are what their README says and what the shapes still make.

use std::path::PathBuf;

use sdf_grid::shapes::PegInHole;
use sdf_grid::{LengthUnit, RepairOptions, mesh_io};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

#[test]
fn every_mesh_has_the_hash_in_the_readme() {
    let readme = std::fs::read_to_string(folder().join("README.md")).expect("a README");
    let mut meshes = 0;
    for entry in std::fs::read_dir(folder()).expect("the folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "obj") {
            continue;
        }
        meshes += 1;
        let name = path
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let row = readme
            .lines()
            .find(|l| l.starts_with(&format!("| {name} |")))
            .unwrap_or_else(|| panic!("{name} is not in the README"));
        let hash = blake3::hash(&std::fs::read(&path).expect("the file")).to_string();
        assert!(row.contains(&hash), "{name} has hash {hash}");
    }
    assert_eq!(meshes, 2 * PegInHole::ALL.len());
}

#[test]
fn every_pair_is_what_the_shapes_make() {
    for pair in PegInHole::ALL {
        let (hole, peg) = pair.pair(0.0).expect("valid clearance");
        for (mesh, part) in [(hole, "hole"), (peg, "peg")] {
            let path = folder().join(format!("{}_{part}.obj", pair.name()));
            let options = RepairOptions::default();
            let (read, report) = mesh_io::read(&path, LengthUnit::M, &options).expect("readable");
            assert_eq!(report.warnings(), Vec::<String>::new());
            assert_eq!(read.triangles(), mesh.triangles());
            // Sines differ in the last digit between systems.
            let apart = read
                .vertices()
                .iter()
                .zip(mesh.vertices())
                .map(|(a, b)| a.distance(*b))
                .fold(0.0, f64::max);
            assert!(apart < 1e-16, "{apart}");
        }
    }
}
