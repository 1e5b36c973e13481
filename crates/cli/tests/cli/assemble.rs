//! `pegfit assemble` from the outside.

use glam::{DQuat, DVec3};
use sdf_grid::mesh_io;
use sdf_grid::shapes::PegInHole;

use crate::common::{refuse, succeed, words};

/// A folder with the parts of a pair, apart and turned.
fn loose_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    std::fs::create_dir(&parts).unwrap();
    let (hole, peg) = PegInHole::Rectangular.pair(2e-4).unwrap();
    let turned = peg.transformed(DQuat::from_rotation_x(1.1), DVec3::new(0.2, 0.1, 0.0));
    mesh_io::write_obj(parts.join("hole.obj"), &hole).unwrap();
    mesh_io::write_obj(parts.join("peg.obj"), &turned).unwrap();
    std::fs::write(parts.join("notes.txt"), "no part").unwrap();
    folder
}

/// The scene that is written comes apart as the report says, and the page needs nothing else.
#[test]
fn loose_parts_become_a_scene() {
    let folder = loose_folder();
    let said = succeed(
        folder.path(),
        &words("assemble parts --unit m -o whole.toml --html whole.html --json -q"),
    );
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["parts"], serde_json::json!(["hole", "peg"]));
    let best = &found["assemblies"][0];
    assert_eq!(best["placed"].as_array().unwrap().len(), 2);
    assert_eq!(best["comes_apart"], true, "{said}");
    assert_eq!(best["steps"].as_array().unwrap().len(), 1);
    let report = std::fs::read_to_string(folder.path().join("whole.json")).unwrap();
    assert!(report.contains("\"certain\""));
    let page = std::fs::read_to_string(folder.path().join("whole.html")).unwrap();
    assert!(page.contains("peg onto hole") && !page.contains("://"));
    let said = succeed(folder.path(), &words("disassemble whole.toml --json -q"));
    let apart: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(apart["apart"], true, "{said}");
}

/// The places that one search found are those of the next one, which does not search again; a wider
/// beam goes on from them, other parts do not.
#[test]
fn what_was_found_is_kept_for_the_next_search() {
    let folder = loose_folder();
    let root = folder.path();
    let line = "assemble parts --unit m --seconds 0 --resume found.journal --json -q";
    let run = || {
        let found: serde_json::Value = serde_json::from_str(&succeed(root, &words(line))).unwrap();
        found["assemblies"].clone()
    };
    let first = run();
    let journal = std::fs::read(root.join("found.journal")).unwrap();
    assert_eq!(first, run());
    // Whatever is searched is written down: nothing was.
    assert_eq!(std::fs::read(root.join("found.journal")).unwrap(), journal);
    succeed(root, &words(&format!("{line} --beam 6")));
    let said = refuse(root, &words(&format!("{line} --mating-clearance 0.001")));
    assert!(
        said.contains("found.journal") && said.contains("same parts"),
        "{said}"
    );
}

#[test]
fn what_cannot_be_assembled_is_refused() {
    let folder = loose_folder();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let cases = [
        ("assemble empty", "files that end with obj, stl"),
        ("assemble parts --only peg", "2 to 200 parts, found 1"),
        ("assemble parts --only nobody", "one of hole, peg"),
        ("assemble parts --fix nobody", "one of hole, peg"),
        ("assemble parts --place peg", "PART=x,y,z,qx,qy,qz,qw"),
        (
            "assemble parts --place peg=1,2",
            "x,y,z,qx,qy,qz,qw in metres",
        ),
        ("assemble parts --beam 0", "beam must be 1 or more"),
        ("assemble parts --seconds=-1", "--seconds"),
        ("assemble nowhere.obj", "nowhere.obj"),
    ];
    for (line, expected) in cases {
        let said = refuse(folder.path(), &words(line));
        assert!(said.contains(expected), "{line}: {said}");
    }
    assert!(!folder.path().join("assembly.toml").exists());
}

/// Every export has both parts; the meshes that are read stay as they are.
#[test]
fn an_assembly_is_exported() {
    let folder = loose_folder();
    let root = folder.path();
    let line = "assemble parts --unit m -o whole.toml -q --glb whole.glb --exploded apart.glb \
                --urdf whole.urdf --mjcf whole.xml";
    succeed(root, &words(line));
    for file in ["whole.glb", "apart.glb", "whole.urdf"] {
        let listed = succeed(root, &["scene", file]);
        assert!(
            listed.contains("hole") && listed.contains("peg"),
            "{file}: {listed}"
        );
    }
    assert_ne!(
        std::fs::read(root.join("whole.glb")).unwrap(),
        std::fs::read(root.join("apart.glb")).unwrap()
    );
    let text = std::fs::read_to_string(root.join("whole.xml")).unwrap();
    assert!(
        text.contains("<body name=\"peg\"") && text.contains("type=\"slide\""),
        "{text}"
    );
    assert!(root.join("whole-peg.obj").exists());
    std::fs::copy(root.join("whole.glb"), root.join("parts/peg.glb")).unwrap();
    let said = refuse(root, &words("assemble parts --unit m --glb parts/peg.glb"));
    assert!(said.contains("another name than that of a part"), "{said}");
}
