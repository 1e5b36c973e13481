//! glTF and 3MF: placed parts, units, solids by name, and every lie a file can tell about itself.

use std::io::Write;

use glam::{DMat4, DQuat, DVec3};
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LengthUnit, MeshError, RepairReport, TriangleMesh, shapes};
use serde_json::{Value, json};

/// A box of 2 x 3 x 4.
fn cuboid() -> TriangleMesh {
    shapes::cuboid(DVec3::new(2.0, 3.0, 4.0)).expect("valid size")
}

fn clean(
    bytes: &[u8],
    format: MeshFormat,
    solid: Option<&str>,
) -> Result<(TriangleMesh, RepairReport), MeshError> {
    let options = ReadOptions {
        unit: LengthUnit::Foot,
        solid: solid.map(str::to_owned),
        ..ReadOptions::default()
    };
    MeshFile::parse("test", bytes, format, None)?.clean(&options)
}

fn message(bytes: &[u8], format: MeshFormat) -> String {
    clean(bytes, format, None).expect_err("refused").to_string()
}

/// A document with the cuboid in two primitives (indexed in 16 and 32 bits), placed twice: as it
/// is, and mirrored, turned and moved through two nodes.
fn document() -> (Value, Vec<u8>) {
    let mesh = cuboid();
    let mut bin = Vec::new();
    for v in mesh.vertices() {
        for x in v.as_vec3().to_array() {
            bin.extend(x.to_le_bytes());
        }
    }
    let positions = bin.len();
    let (first, second) = mesh.triangles().split_at(5);
    first
        .as_flattened()
        .iter()
        .for_each(|&i| bin.extend((i as u16).to_le_bytes()));
    bin.extend([0, 0]);
    let middle = bin.len();
    second
        .as_flattened()
        .iter()
        .for_each(|&i| bin.extend(i.to_le_bytes()));
    let bounds = mesh.bounds();
    let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let document = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "name": "block"},
            {"children": [2], "translation": [10.0, 0.0, 0.0]},
            {"mesh": 0, "name": "mirror", "rotation": turn.as_quat().to_array(),
             "scale": [-1.0, 2.0, 1.0]},
        ],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0}, "indices": 1},
            {"attributes": {"POSITION": 0}, "indices": 2},
        ]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3",
             "count": mesh.vertices().len(),
             "min": bounds.min.to_array(), "max": bounds.max.to_array()},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 15},
            {"bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": 21},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions},
            {"buffer": 0, "byteOffset": positions, "byteLength": 30},
            {"buffer": 0, "byteOffset": middle, "byteLength": bin.len() - middle},
        ],
        "buffers": [{"byteLength": bin.len()}],
    });
    (document, bin)
}

pub(crate) fn glb(document: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(document).expect("text");
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + text.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

#[test]
fn glb_places_every_node() {
    let (document, bin) = document();
    let file = glb(&document, &bin);
    let (mesh, report) = clean(&file, MeshFormat::Gltf, None).expect("two boxes");
    assert_eq!((report.components, report.flipped_faces), (2, 0));
    assert!(report.watertight);
    // Metres, whatever unit was given; the second box is twice as large.
    assert!((mesh.volume() - 24.0 * 3.0).abs() < 1e-4);
    let (mirror, report) = clean(&file, MeshFormat::Gltf, Some("mirror")).expect("one box");
    assert_eq!((report.components, report.flipped_faces), (1, 0));
    let place = DMat4::from_translation(DVec3::new(10.0, 0.0, 0.0))
        * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)
        * DMat4::from_scale(DVec3::new(-1.0, 2.0, 1.0));
    let expected = place.transform_point3(cuboid().centroid());
    assert!(mirror.centroid().distance(expected) < 1e-5);
}

#[test]
fn gltf_buffers_may_be_text_or_files_beside() {
    use base64::Engine;
    let (mut document, bin) = document();
    let text = base64::engine::general_purpose::STANDARD.encode(&bin);
    let expected = clean(&glb(&document, &bin), MeshFormat::Gltf, None)
        .expect("boxes")
        .0;
    document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{text}"));
    let file = serde_json::to_vec(&document).expect("text");
    assert_eq!(
        clean(&file, MeshFormat::Gltf, None).expect("boxes").0,
        expected
    );
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("two boxes.bin"), &bin).expect("room");
    document["buffers"][0]["uri"] = json!("two%20boxes.bin");
    let path = folder.path().join("boxes.gltf");
    std::fs::write(&path, serde_json::to_vec(&document).expect("text")).expect("room");
    let options = ReadOptions::default();
    let read = sdf_grid::mesh_io::read_with(&path, &options)
        .expect("boxes")
        .0;
    assert_eq!(read, expected);
    for elsewhere in [
        "../x.bin",
        "/etc/passwd",
        "http://example.org/x.bin",
        "%2e%2e/x",
    ] {
        document["buffers"][0]["uri"] = json!(elsewhere);
        std::fs::write(&path, serde_json::to_vec(&document).expect("text")).expect("room");
        let error = sdf_grid::mesh_io::read_with(&path, &options).expect_err("refused");
        let message = error.to_string();
        assert!(message.contains("buffer 0"), "{elsewhere}: {message}");
    }
}

#[test]
fn what_a_gltf_file_claims_is_checked() {
    let cases = [
        // Four thousand million of each.
        ("/accessors/0/count", json!(4_000_000_000u64), "4000000000"),
        ("/accessors/1/count", json!(4_000_000_000u64), "accessor 1"),
        (
            "/bufferViews/0/byteOffset",
            json!(4_000_000_000u64),
            "accessor 0",
        ),
        (
            "/bufferViews/1/byteLength",
            json!(4_000_000_000u64),
            "accessor 1",
        ),
        ("/buffers/0/byteLength", json!(4_000_000_000u64), "buffer 0"),
        ("/accessors/1/type", json!("VEC3"), "accessor 1"),
        (
            "/accessors/0/componentType",
            json!(5123),
            "VEC3 of FLOAT, found VEC3 of UNSIGNED_SHORT",
        ),
        ("/scenes/0/nodes", json!([1, 1]), "one place in the tree"),
        ("/scenes/0/nodes", json!([7]), "glTF 2.0"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(900),
            "accessors, found 900",
        ),
        ("/asset/version", json!("1.0"), "glTF 2.0"),
    ];
    for (pointer, value, expected) in cases {
        let (mut document, bin) = document();
        *document.pointer_mut(pointer).expect("there") = value;
        let found = message(&glb(&document, &bin), MeshFormat::Gltf);
        assert!(found.contains(expected), "{pointer}: {found}");
    }
    let (mut circle, bin) = document();
    circle["nodes"][2]["children"] = json!([1]);
    let found = message(&glb(&circle, &bin), MeshFormat::Gltf);
    assert!(found.contains("one place in the tree"), "{found}");
    let (document, mut bin) = document();
    // An index beyond the vertices.
    let at = document["bufferViews"][1]["byteOffset"]
        .as_u64()
        .expect("a number") as usize;
    bin[at] = 200;
    let found = message(&glb(&document, &bin), MeshFormat::Gltf);
    assert!(
        found.contains("vertex indices below 8, found 200"),
        "{found}"
    );
}

#[test]
fn a_glb_shorter_than_its_header_is_refused() {
    // Found by fuzzing: the stated length of 2 was subtracted from.
    let found = message(b"glTF\x02\0+\0\x02\0\0\0SO{\"ass", MeshFormat::Gltf);
    assert!(
        found.contains("byte 8") && found.contains("found 2"),
        "{found}"
    );
}

#[test]
fn strips_and_fans_are_triangles() {
    // A tetrahedron as a strip of its four faces, and as a fan closed by one more triangle.
    let corners = [
        [0.0f32; 3],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let parts: [&[(u64, &[u8])]; 2] = [
        &[(5, &[0, 1, 2, 3, 0, 1])],
        &[(6, &[0, 1, 2, 3, 1]), (4, &[1, 3, 2])],
    ];
    for part in parts {
        let mut bin: Vec<u8> = corners
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let mut views = vec![json!({"buffer": 0, "byteLength": bin.len()})];
        let mut accessors = vec![
            json!({"bufferView": 0, "componentType": 5126, "type": "VEC3",
            "count": 4, "min": [0, 0, 0], "max": [1, 1, 1]}),
        ];
        let mut primitives = Vec::new();
        for (mode, indices) in part {
            views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": indices.len()}));
            accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5121,
                "type": "SCALAR", "count": indices.len()}));
            primitives.push(json!({"attributes": {"POSITION": 0}, "mode": mode,
                "indices": accessors.len() - 1}));
            bin.extend(*indices);
        }
        let document = json!({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "meshes": [{"primitives": primitives}],
            "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bin.len()}]});
        let (mesh, report) = clean(&glb(&document, &bin), MeshFormat::Gltf, None).expect("closed");
        assert!(report.watertight, "{report:?}");
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
        assert!(
            report.flipped_faces == 0 || report.flipped_faces == 4,
            "alike: {report:?}"
        );
    }
}

pub(crate) fn archive(files: &[(&str, &str)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(method);
    for (name, text) in files {
        writer.start_file(*name, options).expect("a name");
        writer.write_all(text.as_bytes()).expect("memory");
    }
    writer.finish().expect("memory").into_inner()
}

pub(crate) const RELS: &str = r#"<?xml version="1.0"?><Relationships>
<Relationship Target="/3D/3dmodel.model" Id="a"
 Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;

pub(crate) fn mesh_xml(mesh: &TriangleMesh) -> String {
    let mut text = "<mesh><vertices>".to_owned();
    for v in mesh.vertices() {
        text += &format!(r#"<vertex x="{}" y="{}" z="{}"/>"#, v.x, v.y, v.z);
    }
    text += "</vertices><triangles>";
    for [a, b, c] in mesh.triangles() {
        text += &format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}" pid="1"/>"#);
    }
    text + "</triangles></mesh>"
}

pub(crate) fn model(unit: &str, resources: &str, build: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><!-- a test -->
        <model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
         xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06">
        <resources>{resources}</resources><build>{build}</build></model>"#
    )
}

fn threemf(text: &str) -> Vec<u8> {
    let files = [("_rels/.rels", RELS), ("3D/3dmodel.model", text)];
    archive(&files, zip::CompressionMethod::Deflated)
}

#[test]
fn a_3mf_is_built_in_its_own_unit() {
    let object = format!(
        r#"<object id="4" name="A &amp; B">{}</object>"#,
        mesh_xml(&cuboid())
    );
    for (unit, metre) in [
        ("micron", 1e-6),
        ("millimeter", 1e-3),
        ("centimeter", 1e-2),
        ("inch", 0.0254),
        ("foot", 0.3048),
        ("meter", 1.0),
    ] {
        let file = threemf(&model(unit, &object, r#"<item objectid="4"/>"#));
        let (mesh, report) = clean(&file, MeshFormat::ThreeMf, Some("A & B")).expect("a box");
        assert!(report.watertight);
        let expected = 24.0 * f64::powi(metre, 3);
        assert!((mesh.volume() / expected - 1.0).abs() < 1e-12, "{unit}");
    }
    let file = threemf(&model("ell", &object, r#"<item objectid="4"/>"#));
    assert!(message(&file, MeshFormat::ThreeMf).contains("\"ell\""));
}

#[test]
fn components_are_placed_across_models() {
    // A quarter turn about z (row vectors), then along x; the other part mirrored in z.
    let assembly = r#"<object id="7" name="pair"><components>
        <component objectid="1" p:path="/3D/Objects/box.model"
         transform="0 1 0 -1 0 0 0 0 1 100 0 0"/>
        <component objectid="1" p:path="/3D/Objects/box.model"
         transform="1 0 0 0 1 0 0 0 -1 0 0 0"/></components></object>
        <object id="8" type="support"><mesh/></object>"#;
    let root = model(
        "millimeter",
        assembly,
        r#"<item objectid="8"/><item objectid="7" transform="1 0 0 0 1 0 0 0 1 0 0 50"/>"#,
    );
    let part = model(
        "millimeter",
        &format!(r#"<object id="1">{}</object>"#, mesh_xml(&cuboid())),
        "",
    );
    let files = [
        ("_rels/.rels", RELS),
        ("3D/3dmodel.model", root.as_str()),
        ("3D/Objects/box.model", part.as_str()),
    ];
    let file = archive(&files, zip::CompressionMethod::Stored);
    let (mesh, report) = clean(&file, MeshFormat::ThreeMf, Some("pair")).expect("two boxes");
    assert_eq!((report.components, report.flipped_faces), (2, 0));
    assert!((mesh.volume() - 48e-9).abs() < 1e-20);
    let c = cuboid().centroid();
    let first = DVec3::new(100.0 - c.y, c.x, c.z + 50.0);
    let second = DVec3::new(c.x, c.y, 50.0 - c.z);
    let expected = 0.5e-3 * (first + second);
    assert!(mesh.centroid().distance(expected) < 1e-12);
}

#[test]
fn what_a_3mf_file_claims_is_checked() {
    let check = |resources: &str, build: &str, expected: &str| {
        let found = message(
            &threemf(&model("inch", resources, build)),
            MeshFormat::ThreeMf,
        );
        assert!(found.contains(expected), "{resources}: {found}");
    };
    let item = r#"<item objectid="1"/>"#;
    check("", item, "object 1");
    check("", r#"<item objectid="x"/>"#, "objectid");
    check("", r#"<item objectid="1" transform="1 0"/>"#, "12 numbers");
    check(
        "",
        r#"<item objectid="1" p:path="/3D/none.model"/>"#,
        "none.model",
    );
    let own = r#"<object id="1"><components><component objectid="1"/></components></object>"#;
    check(own, item, "levels");
    check(
        r#"<object id="1"><mesh><vertices><vertex x="1" y="2"/>"#,
        item,
        "\"z\"",
    );
    let beyond = r#"<object id="1"><mesh><vertices/><triangles>
        <triangle v1="0" v2="1" v3="4000000000"/></triangles></mesh></object>"#;
    check(beyond, item, "vertex indices below 0");
    // Each object places the one before twice: 2^60 boxes.
    let mut doubling = format!(r#"<object id="0">{}</object>"#, mesh_xml(&cuboid()));
    for id in 1..60 {
        let below = format!(r#"<component objectid="{}"/>"#, id - 1);
        doubling +=
            &format!(r#"<object id="{id}"><components>{below}{below}</components></object>"#);
    }
    check(&doubling, r#"<item objectid="59"/>"#, "objects placed");
    assert!(message(b"PK", MeshFormat::ThreeMf).contains("zip"));
    let empty = archive(
        &[("_rels/.rels", "<Relationships/>")],
        zip::CompressionMethod::Stored,
    );
    assert!(message(&empty, MeshFormat::ThreeMf).contains("a 3D model"));
    // A megabyte of spaces for every kilobyte: cut off, so that the XML does not end.
    let bomb = model("inch", &" ".repeat(20_000_000), item);
    let file = threemf(&bomb);
    assert!(file.len() < 40_000);
    assert!(clean(&file, MeshFormat::ThreeMf, None).is_err());
}

#[test]
fn headers_may_claim_anything() {
    // 4e9 facets in a binary STL, 4e9 vertices or faces in a PLY: refused before anything is made.
    let mut stl = vec![0; 84 + 50];
    stl[80..84].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    assert!(message(&stl, MeshFormat::Stl).contains("4000000000 facets"));
    for (vertices, faces, kind) in [
        (4_000_000_000u64, 1u64, "ascii"),
        (1, 4_000_000_000, "ascii"),
        (4_000_000_000, 1, "binary_little_endian"),
        (1, 4_000_000_000, "binary_big_endian"),
    ] {
        let text = format!(
            "ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\n\
             property float y\nproperty float z\nelement face {faces}\n\
             property list uchar int vertex_indices\nend_header\n0 0 0 3 4 5 3 6 7 8"
        );
        let found = message(text.as_bytes(), MeshFormat::Ply);
        assert!(found.contains("4000000000"), "{found}");
    }
    // A list that claims 4e9 entries.
    let mut list = b"ply\nformat binary_little_endian 1.0\nelement vertex 0\n\
        element face 1\nproperty list uint int vertex_indices\nend_header\n"
        .to_vec();
    list.extend(4_000_000_000u32.to_le_bytes());
    list.extend([0; 64]);
    assert!(clean(&list, MeshFormat::Ply, None).is_err());
}

#[test]
fn stl_corner_cases() {
    let closed = |x: f64| -> String {
        let box_ = cuboid().transformed(DQuat::IDENTITY, DVec3::X * x);
        let corner = |v: u32| {
            let v = box_.vertices()[v as usize];
            format!("vertex {} {} {}\n", v.x, v.y, v.z)
        };
        let facet = |t: &[u32; 3]| {
            let corners: String = t.iter().map(|&v| corner(v)).collect();
            format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
        };
        box_.triangles().iter().map(facet).collect()
    };
    let (left, right) = (closed(0.0), closed(9.0));
    let solids = |bytes: &[u8]| {
        MeshFile::parse("test", bytes, MeshFormat::Stl, None)
            .expect("read")
            .solids()
            .into_iter()
            .map(|s| (s.name, s.triangles))
            .collect::<Vec<_>>()
    };
    let text = format!(
        "SOLID  left part\n{left}endsolid\nsolid\nendsolid\nsolid right\n{right}endsolid right\n"
    );
    let expected = vec![("left part".to_owned(), 12), ("right".to_owned(), 12)];
    assert_eq!(solids(text.as_bytes()), expected);
    assert_eq!(solids(text.replace('\n', "\r\n").as_bytes()), expected);
    assert_eq!(solids(text.replace('\n', "\r").as_bytes()), expected);
    assert_eq!(solids(format!("\u{feff}{text}").as_bytes()), expected);
    // A binary file that calls itself solid and goes on after its facets.
    let mut binary = b"solid made by a program".to_vec();
    binary.resize(80, 0);
    binary.extend(1u32.to_le_bytes());
    binary.resize(84 + 50, 0);
    binary.extend(b"colour table of the program");
    assert_eq!(solids(&binary), vec![(String::new(), 1)]);
}
