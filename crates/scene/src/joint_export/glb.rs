//! GLB (binary glTF 2.0): parts in their places, for viewers.

use std::borrow::Cow;
use std::path::Path;

use fft_correlate::Pose;
use gltf::binary::{Glb, Header};
use sdf_grid::{TriangleMesh, atomic};
use serde_json::{Value, json};

use super::error::ExportError;

/// Colours of parts, red, green, blue, linear; the next part has the next one.
const COLOURS: [[f32; 3]; 8] = [
    [0.50, 0.53, 0.56],
    [0.10, 0.33, 0.63],
    [0.76, 0.32, 0.06],
    [0.12, 0.42, 0.15],
    [0.45, 0.18, 0.50],
    [0.72, 0.55, 0.07],
    [0.06, 0.45, 0.47],
    [0.55, 0.11, 0.13],
];

/// Numbers that say what glTF's buffers hold.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A part in its place.
///
/// ```
/// use fft_correlate::Pose;
/// use pegfit_scene::{GlbPart, write_glb};
/// use sdf_grid::{LengthUnit, RepairOptions, mesh_io, shapes};
///
/// let plate = shapes::plate(0.02, 0.005)?;
/// # let folder = tempfile::tempdir()?;
/// let file = folder.path().join("plate.glb");
/// write_glb(&[GlbPart { name: "plate", mesh: &plate, pose: Pose::IDENTITY }], &file)?;
/// // glTF is in metres; the unit given is for files that state none.
/// let (read, _) = mesh_io::read(&file, LengthUnit::Mm, &RepairOptions::default())?;
/// assert!((read.volume() - plate.volume()).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct GlbPart<'a> {
    /// What its node is called.
    pub name: &'a str,
    /// In its own frame, metres.
    pub mesh: &'a TriangleMesh,
    /// From its own frame to that of the file, metres.
    pub pose: Pose,
}

/// Writes parts as GLB in metres, each a node with its mesh in its own frame (single precision). Axes
/// are those of the poses, though viewers show y upwards.
///
/// # Errors
/// If the file cannot be written, or would have 4 GiB or more.
pub fn write_glb(parts: &[GlbPart], path: &Path) -> Result<(), ExportError> {
    let large = |bytes: usize| ExportError::Large {
        path: path.to_owned(),
        bytes,
    };
    let vertices: usize = parts.iter().map(|p| p.mesh.vertices().len()).sum();
    let triangles: usize = parts.iter().map(|p| p.mesh.triangles().len()).sum();
    let bytes = 12 * (vertices + triangles);
    // With room for names.
    if bytes > (u32::MAX as usize) / 2 {
        return Err(large(bytes));
    }
    let mut buffer = Buffer::default();
    let meshes: Vec<Value> = (parts.iter().enumerate())
        .map(|(i, part)| {
            let [position, indices] = buffer.add(part.mesh);
            json!({"name": part.name, "primitives": [{
                "attributes": {"POSITION": position}, "indices": indices,
                "material": i % COLOURS.len(),
            }]})
        })
        .collect();
    let nodes = parts.iter().enumerate().map(|(i, part)| {
        json!({"name": part.name, "mesh": i,
            "translation": part.pose.translation.to_array(),
            "rotation": part.pose.rotation.normalize().to_array()})
    });
    let material = |[r, g, b]: &[f32; 3]| {
        json!({"pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6,
        }})
    };
    let document = json!({
        "asset": {"version": "2.0", "generator": "pegfit"},
        "scene": 0,
        "scenes": [{"nodes": (0..parts.len()).collect::<Vec<_>>()}],
        "nodes": nodes.collect::<Vec<_>>(),
        "meshes": meshes,
        "materials": COLOURS.iter().map(material).collect::<Vec<_>>(),
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.bytes.len()}],
    });
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: Cow::Owned(document.to_string().into_bytes()),
        bin: Some(Cow::Owned(buffer.bytes)),
    };
    let bytes = glb.to_vec().map_err(|source| ExportError::Glb {
        path: path.to_owned(),
        source: Box::new(source),
    })?;
    Ok(atomic::write(path, &bytes)?)
}

/// Numbers of all meshes, and what they are.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds a mesh; its accessors for positions and indices.
    fn add(&mut self, mesh: &TriangleMesh) -> [usize; 2] {
        let points: Vec<[f32; 3]> = (mesh.vertices().iter())
            .map(|v| v.as_vec3().to_array())
            .collect();
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in &points {
            for k in 0..3 {
                min[k] = min[k].min(point[k]);
                max[k] = max[k].max(point[k]);
            }
        }
        let first = self.accessors.len();
        let numbers = points.iter().flatten().map(|v| v.to_le_bytes());
        self.view(numbers, ARRAY_BUFFER);
        self.accessors.push(json!({
            "bufferView": first, "componentType": FLOAT, "count": points.len(), "type": "VEC3",
            "min": min, "max": max,
        }));
        let numbers = mesh.triangles().iter().flatten().map(|i| i.to_le_bytes());
        self.view(numbers, ELEMENT_ARRAY_BUFFER);
        self.accessors.push(json!({
            "bufferView": first + 1, "componentType": UNSIGNED_INT,
            "count": 3 * mesh.triangles().len(), "type": "SCALAR",
        }));
        [first, first + 1]
    }

    fn view(&mut self, numbers: impl Iterator<Item = [u8; 4]>, target: u32) {
        let offset = self.bytes.len();
        self.bytes.extend(numbers.flatten());
        self.views.push(json!({
            "buffer": 0, "byteOffset": offset, "byteLength": self.bytes.len() - offset,
            "target": target,
        }));
    }
}
