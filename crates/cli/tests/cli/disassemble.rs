//! `pegfit disassemble` from the outside.

use std::path::Path;

use glam::DVec3;
use sdf_grid::{TriangleMesh, mesh_io, shapes};

use crate::common::{columns, refuse, succeed};

fn write(folder: &Path, name: &str, mesh: &TriangleMesh) {
    mesh_io::write_obj(folder.join(name), mesh).unwrap();
}

/// A hole's block, a peg in it, and a plate that lies on both.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = shapes::PegInHole::Rectangular.pair(1e-3).unwrap();
    write(folder.path(), "hole.obj", &hole);
    write(folder.path(), "peg.obj", &peg);
    let top = hole.bounds().max.z.max(peg.bounds().max.z);
    let plate = shapes::cuboid(DVec3::new(0.03, 0.03, 0.002)).unwrap();
    write(folder.path(), "plate.obj", &plate);
    let scene = format!(
        "unit = \"m\"\n\
         [[fixed]]\nmesh = \"hole.obj\"\nname = \"block\"\nrotation = [0.6, 0, 0, 0.8]\n\
         [[fixed]]\nmesh = \"plate.obj\"\nrotation = [0.6, 0, 0, 0.8]\nposition = {}\n\
         [moving]\nmesh = \"peg.obj\"\nrotation = [0.6, 0, 0, 0.8]\n",
        {
            let up = glam::DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8) * DVec3::Z;
            let p = (top + 0.0011) * up;
            format!("[{}, {}, {}]", p.x, p.y, p.z)
        }
    );
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

#[test]
fn every_step_has_its_way_and_the_order_is_told() {
    let folder = folder();
    let asked = ["disassemble", "scene.toml", "-o", "steps", "--json", "-q"];
    let said = succeed(folder.path(), &asked);
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["apart"], true, "{said}");
    assert_eq!(found["parts"], serde_json::json!(["block", "plate", "peg"]));
    let steps = found["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    assert_eq!(steps[0]["parts"], serde_json::json!(["plate"]));
    assert_eq!(steps[1]["parts"], serde_json::json!(["peg"]));
    assert_eq!(steps[1]["rest"], serde_json::json!(["block"]));
    for step in steps {
        assert_eq!(step["outcome"], "free", "{said}");
        let file = folder
            .path()
            .join("steps")
            .join(step["file"].as_str().unwrap());
        let rows = columns(&std::fs::read_to_string(file).unwrap());
        assert_eq!(rows.len() as u64, step["poses"].as_u64().unwrap());
        let place = |row: &std::collections::HashMap<String, f64>| {
            DVec3::from_array(["x", "y", "z"].map(|c| row[c]))
        };
        assert!(place(&rows[0]).length() < 1e-9 && rows[0]["length"] == 0.0);
        assert!(place(&rows[rows.len() - 1]).length() > 1e-3);
    }
    let kept = std::fs::read_to_string(folder.path().join("steps/order.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&kept).unwrap(),
        found
    );
    let asked = ["disassemble", "scene.toml", "--html", "page.html", "-q"];
    let told = succeed(folder.path(), &asked);
    assert!(told.contains("comes apart: 3 parts, 2 steps"), "{told}");
    assert!(told.contains("1. plate off block, peg: push"), "{told}");
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("<title>How it comes apart: scene</title>"));
    assert!(page.contains("<p>1. plate off block, peg: push") && !page.contains("src="));
    let data = page.split("const data = ").nth(1).unwrap();
    let data = data.split(";\n").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let parts = data["parts"].as_array().unwrap();
    let triangles = |part: &serde_json::Value| part["triangles"].as_array().unwrap().len() / 3;
    assert_eq!(
        parts.iter().map(triangles).collect::<Vec<_>>(),
        [32, 12, 12]
    );
    // The plate goes, then the peg; nobody sees the plate any more.
    let acts = data["acts"].as_array().unwrap();
    let moved: Vec<_> = acts.iter().map(|a| [&a["moving"], &a["staying"]]).collect();
    assert_eq!(
        serde_json::json!(moved),
        serde_json::json!([[[1], [0, 2]], [[2], [0]]])
    );
    for (act, step) in acts.iter().zip(steps) {
        let poses = act["poses"].as_array().unwrap();
        assert_eq!(poses.len() as u64, step["poses"].as_u64().unwrap());
    }
}

#[test]
fn what_cannot_be_taken_apart_is_refused_by_name() {
    let folder = folder();
    let ask = |more: &[&str]| {
        let asked = [&["disassemble", "scene.toml", "-q"], more].concat();
        refuse(folder.path(), &asked)
    };
    assert!(ask(&["--group", "0"]).contains("largest_group"));
    assert!(ask(&["--seconds", "0"]).contains("--seconds"));
    assert!(ask(&["-o", "nowhere/steps"]).contains("nowhere"));
    let scene = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text + "position = [0.004, 0, 0]\n").unwrap();
    let sunk = ask(&[]);
    assert!(sunk.contains("`block` and `peg` overlap by"), "{sunk}");
}
