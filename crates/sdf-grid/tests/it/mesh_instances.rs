//! glTF: instances, quantized, compressed and sparse meshes, and what is not read.

use glam::DVec3;
use sdf_grid::mesh_io::{MeshFile, MeshFormat, ReadOptions};
use sdf_grid::{LedgerKind, MeshError, shapes};
use serde_json::{Value, json};

use crate::common::assert_close;
use crate::mesh_content::{count, names, read};
use crate::mesh_formats::glb;

/// A document that grows: bytes, views and accessors.
struct Document {
    json: Value,
    bin: Vec<u8>,
}

impl Document {
    /// A box of 2 x 4 x 6 from the origin on, as the mesh of the node `block`.
    fn new() -> Self {
        let mut document = Self {
            json: json!({
                "asset": {"version": "2.0"},
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0, "name": "block"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
            }),
            bin: Vec::new(),
        };
        let cuboid = shapes::cuboid(DVec3::new(2.0, 4.0, 6.0)).expect("valid size");
        let at = |v: &DVec3| (*v + DVec3::new(1.0, 2.0, 3.0)).as_vec3().to_array();
        let corners: Vec<[f32; 3]> = cuboid.vertices().iter().map(at).collect();
        document.floats("VEC3", corners.as_flattened(), 3);
        document.json["accessors"][0]["min"] = json!([0, 0, 0]);
        document.json["accessors"][0]["max"] = json!([2, 4, 6]);
        let indices: Vec<u8> = cuboid
            .triangles()
            .as_flattened()
            .iter()
            .map(|&i| i as u8)
            .collect();
        document.accessor("SCALAR", 5121, &indices, indices.len());
        document
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        let views = self.json["bufferViews"].as_array_mut().expect("a list");
        views.push(view);
        views.len() - 1
    }

    fn accessor(&mut self, shape: &str, kind: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().expect("a list");
        accessors.push(
            json!({"bufferView": view, "componentType": kind, "type": shape, "count": count}),
        );
        accessors.len() - 1
    }

    fn floats(&mut self, shape: &str, numbers: &[f32], width: usize) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(shape, 5126, &bytes, numbers.len() / width)
    }

    fn read(&self) -> Result<MeshFile, MeshError> {
        read(glb(&self.json, &self.bin), MeshFormat::Gltf)
    }
}

/// Cubic metres, and the least corner.
fn measured(file: &MeshFile, solid: Option<&str>) -> (f64, DVec3) {
    let options = ReadOptions {
        solid: solid.map(str::to_owned),
        ..ReadOptions::default()
    };
    let (mesh, report) = file.clean(&options).expect("closed");
    assert!(report.watertight);
    (mesh.volume(), mesh.bounds().min)
}

#[test]
fn instances_are_placed_each_as_a_solid() {
    let mut document = Document::new();
    let at = document.floats("VEC3", &[10.0, 0.0, 0.0, 20.0, 0.0, 0.0, 30.0, 0.0, 0.0], 3);
    let size = document.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0, -1.0], 3);
    // A quarter turn about z, as a normalized 16-bit quaternion, for the second.
    let (none, half) = (32767i16, 23170i16);
    let turns: Vec<u8> = [0, 0, 0, none, 0, 0, half, half, 0, 0, 0, none]
        .into_iter()
        .flat_map(i16::to_le_bytes)
        .collect();
    let turn = document.accessor("VEC4", 5122, &turns, 3);
    document.json["accessors"][turn]["normalized"] = json!(true);
    document.json["nodes"][0]["translation"] = json!([0.0, 0.0, 100.0]);
    document.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing":
        {"attributes": {"TRANSLATION": at, "ROTATION": turn, "SCALE": size}}});
    document.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    for required in [json!([]), json!(["EXT_mesh_gpu_instancing"])] {
        document.json["extensionsRequired"] = required;
        let file = document.read().expect("three boxes");
        assert_eq!(names(&file), ["block"; 3]);
        assert_eq!(count(&file, LedgerKind::Read, "instance"), 3);
        assert_close(measured(&file, None).0, 48.0 * 4.0, 1e-3);
        let expected = [
            (48.0, DVec3::new(10.0, 0.0, 100.0)),
            (96.0, DVec3::new(16.0, 0.0, 100.0)),
            (48.0, DVec3::new(30.0, 0.0, 94.0)),
        ];
        for (i, (volume, low)) in expected.into_iter().enumerate() {
            let found = measured(&file, Some(&(i + 1).to_string()));
            assert_close(found.0, volume, 1e-3);
            assert!(found.1.distance(low) < 1e-3, "{i}: {}", found.1);
        }
    }
    // Numbers of instances that differ, and an accessor that is not there.
    let mut other = Document::new();
    let at = other.floats("VEC3", &[10.0, 0.0, 0.0], 3);
    let size = other.floats("VEC3", &[1.0; 6], 3);
    for (scale, message) in [(size, "1 values of SCALE"), (900, "an accessor as SCALE")] {
        other.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing":
            {"attributes": {"TRANSLATION": at, "SCALE": scale}}});
        let error = other.read().expect_err("refused").to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn quantized_positions_are_read_as_numbers_or_fractions() {
    let corners: [[i32; 3]; 8] =
        std::array::from_fn(|i| [i as i32 & 1, i as i32 >> 1 & 1, i as i32 >> 2 & 1]);
    let faces: [[u8; 3]; 12] = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    // Component type, bytes, largest value.
    for (kind, size, most) in [
        (5120, 1, 127),
        (5121, 1, 255),
        (5122, 2, 32767),
        (5123, 2, 65535),
    ] {
        for normalized in [false, true] {
            let mut document = Document::new();
            // Each position takes a multiple of four bytes.
            let stride = usize::next_multiple_of(3 * size, 4);
            let mut bytes = Vec::new();
            for corner in corners {
                let from = bytes.len();
                let numbers = corner
                    .iter()
                    .flat_map(|&k| (k * most).to_le_bytes()[..size].to_vec());
                bytes.extend(numbers.collect::<Vec<u8>>());
                bytes.resize(from + stride, 0);
            }
            let positions = document.accessor("VEC3", kind, &bytes, 8);
            let view = document.json["accessors"][positions]["bufferView"]
                .as_u64()
                .expect("one");
            document.json["bufferViews"][view as usize]["byteStride"] = json!(stride);
            let accessor = &mut document.json["accessors"][positions];
            accessor["normalized"] = json!(normalized);
            accessor["min"] = json!([0, 0, 0]);
            accessor["max"] = json!([most, most, most]);
            let indices = document.accessor("SCALAR", 5121, faces.as_flattened(), 36);
            let primitive = &mut document.json["meshes"][0]["primitives"][0];
            primitive["attributes"]["POSITION"] = json!(positions);
            primitive["indices"] = json!(indices);
            // Without the extension such numbers are no positions.
            assert!(
                document
                    .read()
                    .expect_err("refused")
                    .to_string()
                    .contains("FLOAT")
            );
            document.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
            let (volume, _) = measured(&document.read().expect("a cube"), None);
            let edge = if normalized { 1.0 } else { f64::from(most) };
            assert_close(volume / edge.powi(3), 1.0, 1e-9);
        }
    }
}

#[test]
fn extensions_that_are_required_and_not_read_are_refused_by_name() {
    for name in [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_meshopt_compression",
        "VENDOR_future_shape",
    ] {
        let mut document = Document::new();
        document.json["extensionsUsed"] = json!([name]);
        let file = document.read().expect("the mesh is there, too");
        assert_eq!(
            count(&file, LedgerKind::Ignored, &format!("extension {name}")),
            1
        );
        document.json["extensionsRequired"] = json!(["KHR_materials_unlit", name]);
        let error = document.read().expect_err("refused").to_string();
        assert!(
            error.contains("extensionsRequired") && error.contains(name),
            "{error}"
        );
        let compressed = error.contains("without compression");
        assert_eq!(compressed, !name.starts_with("VENDOR"), "{error}");
    }
    // Compressed without saying that it must be understood.
    let mut document = Document::new();
    document.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    let accessor = document.json["accessors"][0].as_object_mut().expect("one");
    accessor.remove("bufferView");
    let error = document.read().expect_err("refused").to_string();
    assert!(error.contains("KHR_draco_mesh_compression"), "{error}");
}

#[test]
fn sparse_accessors_replace_what_they_name() {
    let mut document = Document::new();
    // The corners with the largest x move out by 2.
    let far: Vec<u8> = (0..8)
        .filter(|i| {
            let at = 12 * i;
            f32::from_le_bytes(document.bin[at..at + 4].try_into().expect("four")) > 1.0
        })
        .map(|i| i as u8)
        .collect();
    let moved: Vec<u8> = far
        .iter()
        .flat_map(|&i| {
            let at = 12 * i as usize;
            let mut bytes = document.bin[at..at + 12].to_vec();
            bytes[..4].copy_from_slice(&4.0f32.to_le_bytes());
            bytes
        })
        .collect();
    let (indices, values) = (document.view(&far), document.view(&moved));
    document.json["accessors"][0]["sparse"] = json!({
        "count": far.len(),
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values},
    });
    assert_close(
        measured(&document.read().expect("a box"), None).0,
        96.0,
        1e-9,
    );
    // Without a base all other corners are zeros.
    document.json["accessors"][0]
        .as_object_mut()
        .expect("one")
        .remove("bufferView");
    // A pyramid over the far side.
    let (volume, _) = measured(&document.read().expect("a pyramid"), None);
    assert_close(volume, 32.0, 1e-9);
    document.json["accessors"][0]["count"] = json!(4_000_000_000u64);
    assert!(document.read().is_err());
}

#[test]
fn what_moves_vertices_is_refused_unless_asked_for() {
    let mut skinned = Document::new();
    skinned.json["skins"] = json!([{"joints": [0]}]);
    skinned.json["nodes"][0]["skin"] = json!(0);
    let mut morphed = Document::new();
    morphed.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
    let still = morphed.read().expect("a box");
    assert_close(measured(&still, None).0, 48.0, 1e-9);
    assert_eq!(count(&still, LedgerKind::Ignored, "morph target"), 1);
    morphed.json["meshes"][0]["weights"] = json!([0.5]);
    for (document, what) in [(&skinned, "a skin"), (&morphed, "morph targets")] {
        let file = document.read().expect("a document");
        let error = file.clean(&ReadOptions::default()).expect_err("refused");
        assert!(
            matches!(&error, MeshError::Unread { found, .. } if found.contains(what)),
            "{error}"
        );
        let options = ReadOptions {
            lossy: true,
            ..ReadOptions::default()
        };
        assert!(file.clean(&options).is_ok());
    }
}

#[test]
fn what_is_not_in_the_scene_or_no_surface_is_listed() {
    let mut document = Document::new();
    document.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"camera": 0}]);
    document.json["cameras"] = json!([{"type": "perspective", "perspective":
        {"yfov": 1.0, "znear": 0.1}}]);
    document.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 1});
    let primitives = document.json["meshes"][0]["primitives"]
        .as_array_mut()
        .expect("a list");
    primitives.push(lines);
    let text = format!("\u{feff}{}", document.json);
    // A text file with a byte order mark and its buffer as text.
    use base64::Engine;
    let bin = base64::engine::general_purpose::STANDARD.encode(&document.bin);
    let uri = format!(r#"{{"uri":"data:application/octet-stream;base64,{bin}","byteLength""#);
    let text = text.replace(r#"{"byteLength":0"#, r#"{"byteLength""#);
    let text = text.replace(
        r#""buffers":[{"byteLength""#,
        &format!(r#""buffers":[{uri}"#),
    );
    let file = read(text, MeshFormat::Gltf).expect("a document");
    assert_close(measured(&file, None).0, 48.0, 1e-9);
    let ignored = |item| count(&file, LedgerKind::Ignored, item);
    assert_eq!(
        (ignored("node"), ignored("camera"), ignored("scene")),
        (2, 1, 1)
    );
    assert_eq!(ignored("primitive of lines"), 1);
    assert_eq!(count(&file, LedgerKind::Assumed, "scene"), 1);
}
