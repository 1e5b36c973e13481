//! 3MF: units, parts, and what slicers say of them.

use glam::{DQuat, DVec3};
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LedgerKind, LengthUnit, MeshError, TriangleMesh, shapes};

use crate::common::assert_close;
use crate::mesh_content::{count, names, read, volume};
use crate::mesh_formats::{RELS, archive, mesh_xml, model};

/// A cube of an edge, from `x` on.
fn cube(edge: f64, x: f64) -> TriangleMesh {
    let cube = shapes::cuboid(DVec3::splat(edge)).expect("valid size");
    let at = DVec3::splat(edge / 2.0) + x * DVec3::X;
    cube.transformed(DQuat::IDENTITY, at)
}

/// A file of models and others, by their paths.
fn package(files: &[(&str, &str)]) -> MeshFile {
    let files: Vec<_> = [("_rels/.rels", RELS)]
        .iter()
        .chain(files)
        .copied()
        .collect();
    let bytes = archive(&files, zip::CompressionMethod::Deflated);
    read(bytes, MeshFormat::ThreeMf).expect("a 3MF file")
}

const ROOT: &str = "3D/3dmodel.model";

/// Two meshes, 1 and 2, as the object 3 that is built.
fn two(first: &TriangleMesh, second: &TriangleMesh, between: &str) -> String {
    let resources = format!(
        r#"<object id="1" name="body">{}</object><object id="2" {between}>{}</object>
        <object id="3" name="pair"><components><component objectid="1"/>
        <component objectid="2"/></components></object>"#,
        mesh_xml(first),
        mesh_xml(second)
    );
    model("millimeter", &resources, r#"<item objectid="3"/>"#)
}

fn refusal(file: &MeshFile, solid: Option<&str>) -> (String, String) {
    let options = ReadOptions {
        solid: solid.map(str::to_owned),
        ..ReadOptions::default()
    };
    match file.clean(&options) {
        Err(MeshError::Unread { place, found, .. }) => (place, found),
        other => panic!("expected a refusal, found {other:?}"),
    }
}

#[test]
fn every_model_is_in_its_own_unit() {
    for (root, below) in [
        ("millimeter", "inch"),
        ("inch", "millimeter"),
        ("foot", "micron"),
        ("meter", "centimeter"),
    ] {
        let metre = |unit: &str| -> f64 {
            match unit {
                "micron" => 1e-6,
                "millimeter" => 1e-3,
                "centimeter" => 1e-2,
                "inch" => 0.0254,
                "foot" => 0.3048,
                _ => 1.0,
            }
        };
        // Two levels below the root: a translation in the middle model's unit counts in it.
        let assembly = r#"<object id="1" name="asm"><components>
            <component objectid="7" p:path="/3D/Objects/sub.model"
             transform="1 0 0 0 1 0 0 0 1 3 0 0"/></components></object>"#;
        let root_model = model(root, assembly, r#"<item objectid="1"/>"#);
        let middle = r#"<object id="7"><components><component objectid="8"
            p:path="/3D/Objects/leaf.model" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>
            </components></object>"#;
        let middle = model(below, middle, "");
        let leaf = format!(r#"<object id="8">{}</object>"#, mesh_xml(&cube(2.0, 0.0)));
        let leaf = model(root, &leaf, "");
        let file = package(&[
            (ROOT, &root_model),
            ("3D/Objects/sub.model", &middle),
            ("3D/Objects/leaf.model", &leaf),
        ]);
        assert_eq!(names(&file), ["asm"]);
        let (mesh, _) = file.clean(&ReadOptions::default()).expect("a cube");
        let edge: f64 = 2.0 * metre(root);
        assert_close(mesh.volume() / edge.powi(3), 1.0, 1e-9);
        let from = 3.0 * metre(root) + 5.0 * metre(below);
        assert_close(mesh.bounds().min.x / from, 1.0, 1e-9);
        assert_eq!(count(&file, LedgerKind::Read, "object"), 1);
    }
}

#[test]
fn a_model_without_a_unit_is_said_to_be_in_millimetres() {
    let object = format!(r#"<object id="1">{}</object>"#, mesh_xml(&cube(2.0, 0.0)));
    let text = model("inch", &object, r#"<item objectid="1"/>"#);
    let file = package(&[(ROOT, &text.replace(r#"unit="inch""#, ""))]);
    assert_close(volume(&file, None), 8.0, 1e-9);
    assert_eq!(count(&file, LedgerKind::Assumed, "unit"), 1);
    assert_eq!(file.stated_unit(), Some(LengthUnit::Mm));
}

#[test]
fn components_are_solids_named_by_their_assembly() {
    let text = two(&cube(2.0, 0.0), &cube(3.0, 9.0), r#"name="lid""#);
    let file = package(&[(ROOT, &text)]);
    assert_eq!(names(&file), ["pair/body", "pair/lid"]);
    assert_close(volume(&file, Some("pair")), 35.0, 1e-9);
    assert_close(volume(&file, Some("pair/lid")), 27.0, 1e-9);
    assert_close(volume(&file, Some("2")), 27.0, 1e-9);
    // Nested ones keep the name of what is built.
    let deep = text
        .replace(
            "</resources>",
            r#"<object id="4" name="all"><components><component objectid="3"/>
            <component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 50 0"/></components></object>
            </resources>"#,
        )
        .replace(r#"<item objectid="3"/>"#, r#"<item objectid="4"/>"#);
    let file = package(&[(ROOT, &deep)]);
    assert_eq!(names(&file), ["all/body", "all/lid", "all/body"]);
    assert_close(volume(&file, Some("all")), 43.0, 1e-9);
}

#[test]
fn a_negative_part_is_no_material() {
    let text = two(&cube(9.0, 0.0), &cube(3.0, 3.0), r#"name="cut""#);
    let settings = r#"<?xml version="1.0"?><config><object id="3"><metadata key="name" value="x"/>
        <part id="1" subtype="normal_part"><metadata key="name" value="block"/></part>
        <part id="2" subtype="negative_part"/></object></config>"#;
    for path in ["Metadata/model_settings.config", "metadata/Other.config"] {
        let file = package(&[(ROOT, &text), (path, settings)]);
        let (place, found) = refusal(&file, None);
        assert!(place.contains("object 2"), "{place}");
        assert!(found.contains("negative part"), "{found}");
        assert_eq!(names(&file), ["pair"]);
        let options = ReadOptions {
            lossy: true,
            ..ReadOptions::default()
        };
        let (mesh, _) = file.clean(&options).expect("the rest");
        assert_close(mesh.volume() * 1e9, 729.0, 1e-9);
    }
}

#[test]
fn modifiers_and_support_blockers_are_left_out_and_listed() {
    let text = two(&cube(9.0, 0.0), &cube(3.0, 3.0), "");
    for word in ["modifier_part", "support_blocker", "support_enforcer"] {
        let settings = format!(
            r#"<config><object id="3"><part id="2" subtype="{word}"></part></object></config>"#
        );
        let file = package(&[(ROOT, &text), ("Metadata/model_settings.config", &settings)]);
        assert_close(volume(&file, None), 729.0, 1e-9);
        assert_eq!(
            count(&file, LedgerKind::Ignored, &format!("part of type {word}")),
            1
        );
    }
    let settings = r#"<config><object id="3"><part id="2" subtype="magic"/></object></config>"#;
    let file = package(&[(ROOT, &text), ("Metadata/model_settings.config", settings)]);
    assert!(refusal(&file, None).1.contains("magic"));
    // Settings that are no XML.
    let file = package(&[
        (ROOT, &text),
        ("Metadata/project_settings.config", r#"{"a": 1}"#),
        ("Metadata/Slic3r_PE.config", "; generated\n; a = 1\n"),
    ]);
    assert_eq!(file.solids().len(), 2);
}

#[test]
fn runs_of_triangles_are_parts_as_prusaslicer_writes_them() {
    // One mesh of three cubes of 12 triangles each.
    let cubes = [cube(9.0, 0.0), cube(3.0, 3.0), cube(2.0, 20.0)];
    let mut text = [
        "<mesh><vertices>".to_owned(),
        "</vertices><triangles>".to_owned(),
    ];
    for (k, cube) in cubes.iter().enumerate() {
        for v in cube.vertices() {
            text[0] += &format!(r#"<vertex x="{}" y="{}" z="{}"/>"#, v.x, v.y, v.z);
        }
        for t in cube.triangles() {
            let [a, b, c] = t.map(|v| v + 8 * k as u32);
            text[1] += &format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#);
        }
    }
    let object = format!(
        r#"<object id="5" name="print">{}</triangles></mesh></object>"#,
        text.concat()
    );
    let text = model("millimeter", &object, r#"<item objectid="5"/>"#);
    let volume_of = |first: u32, last: u32, kind: &str, name: &str| {
        format!(
            r#"<volume firstid="{first}" lastid="{last}">
            <metadata type="volume" key="name" value="{name}"/>
            <metadata type="volume" key="{kind}</volume>"#
        )
    };
    let settings = |middle: &str| {
        let part = r#"volume_type" value="ModelPart"/>"#;
        let parts = [
            volume_of(0, 11, part, "block"),
            volume_of(12, 23, middle, "middle"),
            volume_of(24, 35, part, "plug"),
        ];
        format!(
            r#"<config><object id="5" instances_count="1">{}</object></config>"#,
            parts.concat()
        )
    };
    let file = |middle: &str| {
        let path = "Metadata/Slic3r_PE_model.config";
        package(&[(ROOT, &text), (path, &settings(middle))])
    };
    for left_out in [
        r#"volume_type" value="ParameterModifier"/>"#,
        r#"volume_type" value="SupportBlocker"/>"#,
        r#"modifier" value="1"/>"#,
    ] {
        let file = file(left_out);
        assert_eq!(names(&file), ["print/block", "print/plug"]);
        assert_close(volume(&file, Some("print")), 737.0, 1e-9);
        assert_close(volume(&file, Some("print/plug")), 8.0, 1e-9);
    }
    let cut = file(r#"volume_type" value="NegativeVolume"/>"#);
    assert!(refusal(&cut, None).1.contains("negative part"));
    assert!(
        refusal(&cut, Some("print/plug"))
            .1
            .contains("negative part")
    );
}

#[test]
fn objects_that_are_no_models_are_no_material_wherever_they_are() {
    for role in ["support", "solidsupport", "surface", "other"] {
        let text = two(
            &cube(9.0, 0.0),
            &cube(3.0, 20.0),
            &format!(r#"type="{role}""#),
        );
        let file = package(&[(ROOT, &text)]);
        assert_close(volume(&file, None), 729.0, 1e-9);
        assert_eq!(count(&file, LedgerKind::Ignored, "object"), 1);
    }
    // As Cura writes supports and modifiers.
    let text = two(&cube(9.0, 0.0), &cube(3.0, 20.0), "");
    let mark = r#"<object id="2" ><metadatagroup><metadata name="cura:support_mesh"
        preserve="1" type="xs:boolean">True</metadata></metadatagroup>"#;
    let file = package(&[(ROOT, &text.replace(r#"<object id="2" >"#, mark))]);
    assert_close(volume(&file, None), 729.0, 1e-9);
    let off = mark.replace("True", "False");
    let file = package(&[(ROOT, &text.replace(r#"<object id="2" >"#, &off))]);
    assert_close(volume(&file, None), 756.0, 1e-9);
}

#[test]
fn shapes_of_extensions_that_are_not_read_are_refused_by_name() {
    let text = two(&cube(9.0, 0.0), &cube(3.0, 20.0), "");
    let lattice = r#"<b:beamlattice radius="1"><b:beams/></b:beamlattice></mesh>"#;
    let file = package(&[(ROOT, &text.replacen("</mesh>", lattice, 1))]);
    assert!(refusal(&file, None).1.contains("beamlattice"));
    assert!(refusal(&file, Some("1")).1.contains("beamlattice"));
    // The other solid is not concerned.
    assert_close(volume(&file, Some("2")), 27.0, 1e-9);
    let space = "http://schemas.3mf.io/3dmanufacturing/booleanoperations/2023/07";
    let head = format!(r#"requiredextensions="bo p" xmlns:bo="{space}" unit="#);
    let file = package(&[(ROOT, &text.replacen("unit=", &head, 1))]);
    assert!(refusal(&file, None).1.contains(space));
    // Sets of triangles change nothing.
    let sets = r#"<t:trianglesets><t:triangleset/></t:trianglesets></mesh>"#;
    let file = package(&[(ROOT, &text.replacen("</mesh>", sets, 1))]);
    assert_close(volume(&file, None), 756.0, 1e-9);
}

#[test]
fn models_may_have_a_mark_or_be_utf16() {
    let text = two(&cube(9.0, 0.0), &cube(3.0, 20.0), "");
    let file = package(&[(ROOT, &format!("\u{feff}{text}"))]);
    assert_close(volume(&file, None), 756.0, 1e-9);
    let wide: Vec<u8> = format!("\u{feff}{}", text.replace("UTF-8", "UTF-16"))
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    for (name, bytes) in [("_rels/.rels", RELS.as_bytes()), (ROOT, &wide)] {
        writer.start_file(name, options).expect("a name");
        std::io::Write::write_all(&mut writer, bytes).expect("memory");
    }
    let bytes = writer.finish().expect("memory").into_inner();
    let file = read(bytes, MeshFormat::ThreeMf).expect("a 3MF file");
    assert_close(volume(&file, None), 756.0, 1e-9);
}
