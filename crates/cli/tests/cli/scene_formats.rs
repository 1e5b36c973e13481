//! `pegfit scene` on assemblies whose format states names, places and a unit: 3MF and glTF.

use std::f64::consts::FRAC_PI_2;
use std::io::Write;
use std::path::Path;

use glam::{DQuat, DVec3};
use pegfit_scene::Scene;
use sdf_grid::{LengthUnit, TriangleMesh};
use serde_json::{Value, json};

use crate::common::succeed;
use crate::scene::{parts, roles, told};

/// Where the peg's own frame lies in the assembly, and where a part out of reach does; metres.
const PLACE: DVec3 = DVec3::new(0.0254, -0.0508, 0.0127);
const FAR: DVec3 = DVec3::new(0.508, 0.0, 0.0);

/// A quarter turn, whose matrix has no digits to lose.
fn turn() -> DQuat {
    DQuat::from_rotation_z(FRAC_PI_2)
}

/// Vertices in a frame turned by [`turn`] and shifted by [`PLACE`]: what a placement takes back.
fn in_own_frame(mesh: &TriangleMesh) -> Vec<DVec3> {
    let vertices = mesh.vertices().iter();
    vertices.map(|v| turn().inverse() * (*v - PLACE)).collect()
}

/// Where a mesh that the scene names lies, as `pegfit check` sees it, beside where it should.
fn assert_lies(mesh: &Value, expected: &TriangleMesh, tolerance: f64) {
    let bounds = expected.bounds();
    for (key, corner) in [("min", bounds.min), ("max", bounds.max)] {
        let found: Vec<f64> = serde_json::from_value(mesh["bounds"][key].clone()).unwrap();
        let apart = (DVec3::from_slice(&found) - corner).length();
        assert!(apart < tolerance, "{key}: {found:?}, not {corner}");
    }
}

/// Block and peg of a scene that was just written: usable, in their places, and free of each other.
fn assert_checked(folder: &Path, tolerance: f64) {
    let (hole, peg) = parts();
    let found = told(folder, &["check", "s.toml"]);
    let meshes = found["meshes"].as_array().unwrap();
    assert_eq!(meshes.len(), 2);
    for (mesh, expected) in meshes.iter().zip([&hole, &peg]) {
        assert_eq!(mesh["usable"], true, "{mesh}");
        assert_lies(mesh, expected, tolerance);
    }
    let pair = &found["pairs"][0];
    assert_eq!(pair["shared_volume"], 0.0, "{pair}");
    assert_eq!(pair["next"], json!([]), "{pair}");
}

fn expected_roles(list: [(&str, &str); 3]) -> Vec<(String, String)> {
    list.map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec()
}

/// A mesh of a 3MF model in inches.
fn mesh_xml(vertices: &[DVec3], mesh: &TriangleMesh) -> String {
    let mut text = "<mesh><vertices>".to_owned();
    for v in vertices.iter().map(|v| *v / LengthUnit::Inch.in_metres()) {
        text += &format!("<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>", v.x, v.y, v.z);
    }
    text += "</vertices><triangles>";
    for [a, b, c] in mesh.triangles() {
        text += &format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>");
    }
    text + "</triangles></mesh>"
}

/// A block, a pin in it, and the same pin elsewhere, which is an assembly of one component.
fn write_threemf(path: &Path) {
    let (hole, peg) = parts();
    let block = mesh_xml(hole.vertices(), &hole);
    let pin = mesh_xml(&in_own_frame(&peg), &peg);
    let transform = |shift: DVec3| {
        let [x, y, z] = (shift / LengthUnit::Inch.in_metres()).to_array();
        // Rows: 3MF multiplies row vectors.
        format!("transform=\"0 1 0 -1 0 0 0 0 1 {x} {y} {z}\"")
    };
    let model = format!(
        "<model unit=\"inch\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\
         <resources><object id=\"1\" name=\"block\">{block}</object>\
         <object id=\"2\" name=\"pin\">{pin}</object><object id=\"3\" name=\"pin\"><components>\
         <component objectid=\"2\" {}/></components></object></resources>\
         <build><item objectid=\"1\"/><item objectid=\"2\" {}/><item objectid=\"3\"/></build>\
         </model>",
        transform(FAR),
        transform(PLACE)
    );
    let relations = "<Relationships><Relationship Target=\"/3D/3dmodel.model\" Id=\"a\" \
         Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, text) in [("_rels/.rels", relations), ("3D/3dmodel.model", &model)] {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap();
}

#[test]
fn a_3mf_keeps_its_unit_and_its_places() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_threemf(&at.join("a.3mf"));
    let listed = told(at, &["scene", "a.3mf", "--unit", "m"]);
    let expected = [("block", "listed"), ("pin", "listed"), ("pin", "listed")];
    assert_eq!(roles(&listed), expected_roles(expected));
    // Two of one name: chosen by number, and written by number.
    let found = told(at, &["scene", "a.3mf", "--moving", "2", "-o", "s.toml"]);
    let expected = [("block", "fixed"), ("pin", "moving"), ("pin", "left_out")];
    assert_eq!(roles(&found), expected_roles(expected));
    // A quarter turn exchanges the sides of the peg's own frame.
    let (hole, peg) = parts();
    for (solid, mesh) in [(0, &hole), (1, &peg), (2, &peg)] {
        let size: Vec<f64> =
            serde_json::from_value(found["solids"][solid]["size"].clone()).unwrap();
        let apart = DVec3::from_slice(&size) - mesh.bounds().size();
        assert!(apart.length() < 1e-12, "{size:?}");
    }
    assert_eq!(found["meshes"], json!([]), "read from the file itself");
    let text = std::fs::read_to_string(at.join("s.toml")).unwrap();
    for line in [
        "unit = \"inch\"",
        "solid = \"block\"",
        "solid = 2",
        "name = \"pin\"",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    let scene = Scene::read(at.join("s.toml")).unwrap();
    assert_eq!(scene.unit, LengthUnit::Inch);
    assert_checked(at, 1e-12);
    assert!(succeed(at, &["check", "s.toml"]).contains("pin in block: they do not overlap"));
}

/// `parts.gltf` and the buffer beside it: a frame that holds a block, a peg in it, and a lid, which
/// is the block's mesh once more.
fn write_gltf(folder: &Path) {
    let (hole, peg) = parts();
    // The frame lifts everything by this, and the meshes lie that much lower.
    let lift = DVec3::new(0.0, 0.0, 0.25);
    let block: Vec<DVec3> = hole.vertices().iter().map(|v| *v - lift).collect();
    let (mut bin, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    for (vertices, mesh) in [(&block, &hole), (&in_own_frame(&peg), &peg)] {
        let first = bin.len();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for v in vertices {
            for (axis, x) in v.as_vec3().to_array().into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
                bin.extend(x.to_le_bytes());
            }
        }
        let middle = bin.len();
        bin.extend(
            mesh.triangles()
                .iter()
                .flatten()
                .flat_map(|i| i.to_le_bytes()),
        );
        let view = views.len();
        views.push(json!({"buffer": 0, "byteOffset": first, "byteLength": middle - first}));
        views.push(json!({"buffer": 0, "byteOffset": middle, "byteLength": bin.len() - middle}));
        accessors.push(
            json!({"bufferView": view, "componentType": 5126, "type": "VEC3",
            "count": vertices.len(), "min": low, "max": high}),
        );
        accessors.push(
            json!({"bufferView": view + 1, "componentType": 5125, "type": "SCALAR",
            "count": 3 * mesh.triangles().len()}),
        );
    }
    let mesh =
        |n: usize| json!({"primitives": [{"attributes": {"POSITION": n}, "indices": n + 1}]});
    let document = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "frame", "children": [1, 2, 3], "translation": lift.to_array()},
            {"name": "block", "mesh": 0},
            {"name": "peg", "mesh": 1, "rotation": turn().as_quat().to_array(),
             "translation": (PLACE - lift).to_array()},
            {"name": "lid", "mesh": 0, "translation": FAR.to_array()},
        ],
        "meshes": [mesh(0), mesh(2)],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": "parts.bin", "byteLength": bin.len()}],
    });
    std::fs::create_dir(folder).unwrap();
    std::fs::write(folder.join("parts.bin"), bin).unwrap();
    std::fs::write(folder.join("parts.gltf"), document.to_string()).unwrap();
}

#[test]
fn a_gltf_keeps_the_places_of_its_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_gltf(&at.join("cad"));
    // In metres, as the format says, whatever is asked for; found from the scene in another folder.
    let words = ["scene", "cad/parts.gltf", "--moving", "peg", "--unit", "mm"];
    let found = told(at, &[&words[..], &["-o", "s.toml"]].concat());
    let expected = [("block", "fixed"), ("peg", "moving"), ("lid", "left_out")];
    assert_eq!(roles(&found), expected_roles(expected));
    let text = std::fs::read_to_string(at.join("s.toml")).unwrap();
    for line in [
        "unit = \"m\"",
        "mesh = \"cad/parts.gltf\"",
        "solid = \"peg\"",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    let scene = Scene::read(at.join("s.toml")).unwrap();
    assert_eq!((scene.unit, scene.fixed.meshes.len()), (LengthUnit::M, 1));
    // Single precision a quarter of a metre from the origin.
    assert_checked(at, 1e-7);
}
