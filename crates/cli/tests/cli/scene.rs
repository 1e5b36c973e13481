//! `pegfit scene` from the outside: files of several solids, robots, and scenes that commands take.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use pegfit_scene::Scene;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{LengthUnit, TriangleMesh};
use serde_json::{Value, json};

use crate::common::{refuse, succeed, words};

/// Solids as one OBJ in millimetres, each under its name; where it is placed is in its vertices.
fn obj(solids: &[(&str, &TriangleMesh, DVec3)]) -> String {
    let (mut text, mut first) = (String::new(), 1);
    for (name, mesh, shift) in solids {
        writeln!(text, "o {name}").unwrap();
        for v in mesh.vertices() {
            let v = 1e3 * (*v + *shift);
            writeln!(text, "v {} {} {}", v.x, v.y, v.z).unwrap();
        }
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|i| i + first);
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        first += mesh.vertices().len() as u32;
    }
    text
}

/// The square hole and its peg, 0.5 mm apart on every side.
pub(crate) fn parts() -> (TriangleMesh, TriangleMesh) {
    PegInHole::Rectangular.pair(5e-4).unwrap()
}

/// What the command tells programs.
pub(crate) fn told(folder: &Path, words: &[&str]) -> serde_json::Value {
    let text = succeed(folder, &[words, &["--json"]].concat());
    serde_json::from_str(&text).unwrap()
}

/// Names and roles of the solids.
pub(crate) fn roles(value: &serde_json::Value) -> Vec<(String, String)> {
    let solids = value["solids"].as_array().unwrap();
    let text = |v: &serde_json::Value| v.as_str().unwrap().to_owned();
    solids
        .iter()
        .map(|s| (text(&s["name"]), text(&s["role"])))
        .collect()
}

#[test]
fn an_assembly_becomes_a_scene_that_commands_take() {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = parts();
    let far = DVec3::new(0.5, 0.1, -0.2);
    let solids = [
        ("block", &hole, DVec3::ZERO),
        ("peg", &peg, DVec3::ZERO),
        ("lid", &hole, far),
    ];
    std::fs::write(folder.path().join("a.obj"), obj(&solids)).unwrap();
    let at = folder.path();
    assert!(succeed(at, &["scene", "a.obj"]).contains("--moving NAME"));
    let found = told(at, &["scene", "a.obj", "--moving", "peg", "-o", "s.toml"]);
    let expected = [("block", "fixed"), ("peg", "moving"), ("lid", "left_out")];
    assert_eq!(
        roles(&found),
        expected.map(|(a, b)| (a.to_owned(), b.to_owned()))
    );
    assert_eq!(found["solids"][0]["shared_volume"], 0.0);
    let text = std::fs::read_to_string(at.join("s.toml")).unwrap();
    assert!(
        text.contains("solid = \"peg\"") && text.contains("unit = \"mm\""),
        "{text}"
    );
    // A twenty-fourth of 20 mm, however the assembly is turned.
    assert!(text.contains("spacing = 0.83 "), "{text}");
    let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 0.4));
    let [block, plug] = [&hole, &peg].map(|part| part.transformed(turn, far));
    let solids = [("block", &block, DVec3::ZERO), ("peg", &plug, DVec3::ZERO)];
    std::fs::write(at.join("turned.obj"), obj(&solids)).unwrap();
    told(
        at,
        &["scene", "turned.obj", "--moving", "peg", "-o", "t.toml"],
    );
    let turned = std::fs::read_to_string(at.join("t.toml")).unwrap();
    assert!(turned.contains("spacing = 0.83 "), "{turned}");
    let said = succeed(at, &["check", "s.toml"]);
    assert!(said.contains("peg in block: they do not overlap"), "{said}");
    let coarse = text.split("[lattice]").next().unwrap().to_owned()
        + "[lattice]\nspacing = 2.5\nhalo = 6\nfield_tolerance = 0.01\n[window]\nhalf_extent = 5\n";
    std::fs::write(at.join("coarse.toml"), coarse).unwrap();
    succeed(at, &["plot", "well", "coarse.toml", "--quiet"]);
    // Several that move together, a part of its own for each that stays.
    let near = DVec3::new(0.0, 0.05, 0.0);
    let cap = DVec3::Z * 0.031;
    let solids = [
        ("block", &hole, DVec3::ZERO),
        ("peg", &peg, DVec3::ZERO),
        ("peg", &peg, cap),
        ("block", &hole, near),
    ];
    std::fs::write(folder.path().join("b.obj"), obj(&solids)).unwrap();
    told(
        at,
        &words("scene b.obj --moving 2 --moving 3 --separate -o t.toml"),
    );
    let scene = Scene::read(at.join("t.toml")).unwrap();
    let names: Vec<&str> = scene.fixed_parts().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["block", "block 2"]);
    assert_eq!(
        (scene.moving.meshes.len(), &*scene.moving.name),
        (2, "peg and 1 more")
    );
    told(
        at,
        &[
            "scene", "b.obj", "--moving", "2", "--fixed", "4", "--fixed", "1", "-o", "t.toml",
        ],
    );
    let scene = Scene::read(at.join("t.toml")).unwrap();
    assert_eq!((scene.fixed.meshes.len(), scene.others.len()), (2, 0));
    // By number; what is not asked for is left out.
    let found = told(at, &["scene", "a.obj", "--moving", "2", "--fixed", "1"]);
    assert_eq!(roles(&found)[2].1, "left_out");
    assert!(refuse(at, &["scene", "a.obj", "--moving", "pin"]).contains("2 \"peg\""));
    assert!(refuse(at, &["scene", "a.obj", "--moving", "lid"]).contains("found none"));
}

#[test]
fn what_overlaps_is_named_with_its_volume() {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = parts();
    // A clearance of 0.5 mm on every side: 1.5 mm to the side is 1 mm into the wall of 30 mm height.
    let shift = DVec3::X * 1.5e-3;
    let solids = [("block", &hole, DVec3::ZERO), ("peg", &peg, shift)];
    std::fs::write(folder.path().join("a.obj"), obj(&solids)).unwrap();
    let at = folder.path();
    let found = told(at, &["scene", "a.obj", "--moving", "peg", "-o", "s.toml"]);
    let shared = found["solids"][0]["shared_volume"].as_f64().unwrap();
    let expected = 1e-3 * peg.bounds().size().y * peg.bounds().size().z;
    // Rays along the walls count whole rays: one of 64.
    assert!(
        (shared / expected - 1.0).abs() < 0.03,
        "{shared} {expected}"
    );
    let said = succeed(at, &["check", "s.toml"]);
    assert!(
        said.contains("they share") && said.contains("pegfit path"),
        "{said}"
    );
}

/// Hole and peg turned and shifted in their links, the peg's 2 mm out of the hole by its joint.
#[test]
fn links_of_a_robot_are_placed_by_their_joints() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (hole, peg) = parts();
    std::fs::create_dir(at.join("meshes")).unwrap();
    std::fs::write(
        at.join("meshes/hole.obj"),
        obj(&[("h", &hole, DVec3::ZERO)]),
    )
    .unwrap();
    std::fs::write(at.join("meshes/peg.obj"), obj(&[("p", &peg, DVec3::ZERO)])).unwrap();
    let mesh = |name: &str| {
        format!(
            "<collision><origin xyz=\"0.1 -0.2 0.3\" rpy=\"0.3 -0.5 0.7\"/><geometry>\
             <mesh filename=\"package://arm/meshes/{name}.obj\" scale=\"0.001 0.001 0.001\"/>\
             </geometry></collision>"
        )
    };
    let turn =
        DQuat::from_rotation_z(0.7) * DQuat::from_rotation_y(-0.5) * DQuat::from_rotation_x(0.3);
    // Out of the hole along its axis.
    let lift = turn * (2e-3 * DVec3::Z);
    let urdf = format!(
        "<?xml version=\"1.0\"?><robot name=\"arm\"><link name=\"base\">{}</link>\
         <link name=\"tool\">{}</link><joint name=\"j\" type=\"revolute\">\
         <parent link=\"base\"/><child link=\"tool\"/><origin xyz=\"{} {} {}\"/></joint></robot>",
        mesh("hole"),
        mesh("peg"),
        lift.x,
        lift.y,
        lift.z
    );
    std::fs::write(at.join("arm.urdf"), &urdf).unwrap();
    let found = told(
        at,
        &["scene", "arm.urdf", "--moving", "tool", "-o", "s.toml"],
    );
    assert_eq!(found["meshes"].as_array().unwrap().len(), 2);
    let text = std::fs::read_to_string(at.join("s.toml")).unwrap();
    let scene = Scene::read(at.join("s.toml")).unwrap();
    let (base, tool) = (scene.fixed.pose, scene.moving.pose);
    assert!(
        (base.translation - DVec3::new(0.1, -0.2, 0.3)).length() < 1e-12,
        "{text}"
    );
    assert!(
        (tool.translation - base.translation - lift).length() < 1e-12,
        "{text}"
    );
    assert!(
        (tool.rotation.dot(turn).abs() - 1.0).abs() < 1e-12,
        "{text}"
    );
    let said = succeed(at, &["check", "s.toml", "--json"]);
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["pairs"][0]["next"], serde_json::json!([]), "{said}");
    let circle = urdf.replace("<parent link=\"base\"/>", "<parent link=\"tool\"/>");
    std::fs::write(at.join("circle.urdf"), circle).unwrap();
    assert!(refuse(at, &["scene", "circle.urdf"]).contains("a tree of joints"));
    std::fs::write(at.join("open.urdf"), "<robot><link>").unwrap();
    refuse(at, &["scene", "open.urdf"]);
}

#[test]
fn bodies_of_a_model_are_placed_in_the_world() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (hole, peg) = parts();
    std::fs::write(at.join("hole.obj"), obj(&[("h", &hole, DVec3::ZERO)])).unwrap();
    std::fs::write(at.join("peg.obj"), obj(&[("p", &peg, DVec3::ZERO)])).unwrap();
    let scale = "scale=\"0.001 0.001 0.001\"";
    let mjcf = format!(
        "<mujoco><compiler angle=\"degree\"/><asset><mesh file=\"hole.obj\" {scale}/>\
         <mesh name=\"pin\" file=\"peg.obj\" {scale}/></asset><worldbody>\
         <geom type=\"plane\" size=\"1 1 1\"/>\
         <body name=\"block\" pos=\"0.2 0 0.1\" euler=\"0 0 90\">\
         <geom type=\"mesh\" mesh=\"hole\"/></body>\
         <body name=\"peg\" pos=\"0.2 0 0.1\" euler=\"0 0 270\"><joint type=\"free\"/>\
         <geom type=\"mesh\" mesh=\"pin\" contype=\"0\" conaffinity=\"0\"/>\
         <geom type=\"box\" size=\"0.005 0.004 0.015\"/></body></worldbody></mujoco>"
    );
    std::fs::write(at.join("m.xml"), &mjcf).unwrap();
    let found = told(
        at,
        &[
            "scene", "m.xml", "--moving", "peg", "--visual", "-o", "s.toml",
        ],
    );
    assert_eq!(roles(&found).len(), 2, "{found}");
    let peg_size = &found["solids"][1]["size"];
    let expected = peg.bounds().size().x;
    assert!(
        (peg_size[0].as_f64().unwrap() - expected).abs() < 1e-8,
        "{peg_size}"
    );
    let text = std::fs::read_to_string(at.join("s.toml")).unwrap();
    let scene = Scene::read(at.join("s.toml")).unwrap();
    let there = Pose::new(DQuat::from_rotation_z(FRAC_PI_2), DVec3::new(0.2, 0.0, 0.1));
    let apart = scene.fixed.pose.twist_to(&there);
    assert!(
        apart.linear.length() + apart.angular.length() < 1e-12,
        "{text}"
    );
    // Turned by half a turn more about the same axis.
    let peg_there = there * Pose::new(DQuat::from_rotation_z(PI), DVec3::ZERO);
    assert!(scene.moving.pose.angle_to(&peg_there) < 1e-12, "{text}");
    // The other shapes: a box of twice the half lengths.
    let found = told(at, &["scene", "m.xml", "--moving", "peg"]);
    assert!((found["solids"][1]["size"][2].as_f64().unwrap() - 0.03).abs() < 1e-12);
    // MuJoCo does not find the file, or is missing and would help.
    let include = mjcf.replace("<worldbody>", "<worldbody><include file=\"x.xml\"/>");
    std::fs::write(at.join("i.xml"), include).unwrap();
    let said = refuse(at, &["scene", "i.xml"]);
    assert!(
        said.contains("x.xml") || said.contains("pip install mujoco"),
        "{said}"
    );
    std::fs::write(at.join("w.xml"), "<html></html>").unwrap();
    assert!(refuse(at, &["scene", "w.xml"]).contains("<robot> (URDF) or <mujoco> (MJCF)"));
}

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
