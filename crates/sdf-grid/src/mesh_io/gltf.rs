//! glTF 2.0, JSON (`.gltf`) and binary (`.glb`).
//!
//! The document is parsed and checked by the `gltf` crate; accessors are read here, because its
//! readers trust the offsets in the file. Every node with a mesh is a solid, placed by the
//! transforms above it; the unit is the metre. Axes are left as the file has them.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use glam::{DMat4, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::json::validation::Checked;
use gltf::mesh::{Mode, Semantic};
use gltf::{Accessor, Document, Gltf, Node, Primitive};

use super::bytes;
use super::soup::{Soup, syntax};
use super::unit::LengthUnit;
use crate::mesh::error::MeshError;

/// Nodes below one another; deeper trees are refused.
const DEEPEST: usize = 1000;

/// Reads all meshes of the file's scene, or of its first if none is the default; the solids are
/// named after their nodes.
pub(super) fn parse(file: &str, bytes: &[u8], folder: Option<&Path>) -> Result<Soup, MeshError> {
    // The crate subtracts the header from the length that the file states, and may overflow.
    if let Some(stated) = bytes.strip_prefix(b"glTF").and_then(|b| b.get(4..8)) {
        let stated = stated
            .iter()
            .rev()
            .fold(0u64, |n, &b| n << 8 | u64::from(b));
        if !(12..=bytes.len() as u64).contains(&stated) {
            let expected = format!("a length of 12 .. {} bytes", bytes.len());
            return Err(syntax(file, "byte 8", expected, stated.to_string()));
        }
    }
    let gltf = checked(file, bytes)?;
    let document = &gltf.document;
    let version = &document.as_json().asset.version;
    if !version.starts_with("2.") {
        return Err(syntax(
            file,
            "asset",
            "a glTF 2.0 file",
            format!("version {version:?}"),
        ));
    }
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let Some(scene) = scene else {
        return Err(syntax(file, "scenes", "a scene", "none"));
    };
    let mut reader = GltfReader {
        file,
        buffers: buffers(file, &gltf, folder)?,
        soup: Soup {
            unit: Some(LengthUnit::M),
            ..Soup::default()
        },
        visited: vec![false; document.nodes().len()],
    };
    for node in scene.nodes() {
        reader.place(&node, DMat4::IDENTITY, 0)?;
    }
    Ok(reader.soup)
}

/// The parsed document, every index in it valid.
fn checked(file: &str, bytes: &[u8]) -> Result<Gltf, MeshError> {
    let refused = |e: gltf::Error| syntax(file, "document", "a glTF 2.0 file", e.to_string());
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(refused)?;
    // The crate's validation looks this accessor up before it checks that there is one.
    let json = document.into_json();
    let positions = Checked::Valid(Semantic::Positions);
    for (m, mesh) in json.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let accessor = primitive.attributes.get(&positions);
            if let Some(found) = accessor.filter(|a| a.value() >= json.accessors.len()) {
                let expected = format!("one of {} accessors", json.accessors.len());
                let place = format!("mesh {m}, POSITION");
                return Err(syntax(file, place, expected, found.value().to_string()));
            }
        }
    }
    let document = Document::from_json(json).map_err(refused)?;
    Ok(Gltf { document, blob })
}

/// The triangles of a primitive, all the same way round.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let strip = indices.windows(3).enumerate();
            let turned = |(i, w): (usize, &[u32])| match i % 2 {
                0 => [w[0], w[1], w[2]],
                _ => [w[1], w[0], w[2]],
            };
            strip.map(turned).collect()
        }
        Mode::TriangleFan => {
            let rim = indices.windows(2).skip(1);
            rim.map(|w| [indices[0], w[0], w[1]]).collect()
        }
        _ => indices.as_chunks().0.to_vec(),
    }
}

/// The bytes of every buffer: the binary chunk, `data:` text, or files in `folder`.
fn buffers<'a>(
    file: &str,
    gltf: &'a Gltf,
    folder: Option<&Path>,
) -> Result<Vec<Cow<'a, [u8]>>, MeshError> {
    let document: &Document = &gltf.document;
    document
        .buffers()
        .map(|buffer| {
            let place = format!("buffer {}", buffer.index());
            let data = match buffer.source() {
                Source::Bin => Cow::Borrowed(gltf.blob.as_deref().unwrap_or_default()),
                Source::Uri(uri) => Cow::Owned(uri_bytes(file, &place, uri, folder)?),
            };
            if data.len() < buffer.length() {
                let expected = format!("{} bytes", buffer.length());
                return Err(syntax(
                    file,
                    place,
                    expected,
                    format!("{} bytes", data.len()),
                ));
            }
            Ok(data)
        })
        .collect()
}

fn uri_bytes(
    file: &str,
    place: &str,
    uri: &str,
    folder: Option<&Path>,
) -> Result<Vec<u8>, MeshError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        return text
            .and_then(|text| BASE64.decode(text).ok())
            .ok_or_else(|| syntax(file, place, "base64 data", "something else"));
    }
    // A file beside this one, never one elsewhere: mesh files are untrusted.
    let name = percent_decoded(uri);
    let beside = !uri.contains(':')
        && Path::new(&name)
            .components()
            .all(|c| matches!(c, std::path::Component::Normal(_)));
    match folder {
        Some(folder) if beside => bytes::read_whole(&folder.join(name)),
        _ => {
            let expected = "a buffer in the file or in one beside it";
            Err(syntax(file, place, expected, format!("{uri:?}")))
        }
    }
}

/// `a%20b` as `a b`; sequences that make no sense stay.
fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = (bytes[at] == b'%')
            .then(|| uri.get(at + 1..at + 3))
            .flatten();
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

struct GltfReader<'a> {
    file: &'a str,
    buffers: Vec<Cow<'a, [u8]>>,
    soup: Soup,
    /// Nodes seen: each may be placed once only.
    visited: Vec<bool>,
}

impl GltfReader<'_> {
    /// Adds the meshes of a node and of those below it.
    fn place(&mut self, node: &Node<'_>, above: DMat4, depth: usize) -> Result<(), MeshError> {
        let place = format!("node {}", node.index());
        if std::mem::replace(&mut self.visited[node.index()], true) {
            return Err(syntax(self.file, place, "one place in the tree", "several"));
        }
        if depth > DEEPEST {
            let expected = format!("at most {DEEPEST} nodes above it");
            return Err(syntax(self.file, place, expected, "more"));
        }
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        let transform = above * DMat4::from_cols_array_2d(&columns);
        if let Some(mesh) = node.mesh() {
            let name = node.name().or(mesh.name()).unwrap_or_default();
            self.soup.begin_solid(name);
            for primitive in mesh.primitives() {
                let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
                self.add(&primitive, transform, &place)?;
            }
        }
        node.children()
            .try_for_each(|child| self.place(&child, transform, depth + 1))
    }

    /// Adds a primitive; points and lines say nothing about the solid.
    fn add(
        &mut self,
        primitive: &Primitive<'_>,
        transform: DMat4,
        place: &str,
    ) -> Result<(), MeshError> {
        if !matches!(
            primitive.mode(),
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            return Ok(());
        }
        let positions = primitive
            .get(&gltf::Semantic::Positions)
            .ok_or_else(|| syntax(self.file, place, "positions", "none"))?;
        self.soup.check_room(self.file, positions.count())?;
        let (first, count) = (self.soup.vertices.len() as u32, positions.count());
        self.add_positions(&positions, transform, place)?;
        let indices = match primitive.indices() {
            Some(accessor) => self.indices(&accessor, count, place)?,
            None => (0..count as u32).collect(),
        };
        let mirrored = transform.determinant() < 0.0;
        let before = self.soup.triangles.len();
        for corners in triangles(primitive.mode(), &indices) {
            let [a, b, c] = corners.map(|i| first + i);
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.soup.triangles.push(corners);
        }
        self.soup
            .check_room(self.file, self.soup.triangles.len() - before)
    }

    fn add_positions(
        &mut self,
        positions: &Accessor<'_>,
        transform: DMat4,
        place: &str,
    ) -> Result<(), MeshError> {
        let (types, shape) = ([DataType::F32], Dimensions::Vec3);
        for at in elements(self.file, &self.buffers, positions, shape, &types, place)? {
            let (numbers, _) = at.as_chunks::<4>();
            let [x, y, z] = [0, 1, 2].map(|i| f64::from(f32::from_le_bytes(numbers[i])));
            let position = transform.transform_point3(DVec3::new(x, y, z));
            self.soup.vertices.push(position);
        }
        Ok(())
    }

    fn indices(
        &self,
        accessor: &Accessor<'_>,
        vertices: usize,
        place: &str,
    ) -> Result<Vec<u32>, MeshError> {
        let types = [DataType::U8, DataType::U16, DataType::U32];
        elements(
            self.file,
            &self.buffers,
            accessor,
            Dimensions::Scalar,
            &types,
            place,
        )?
        .map(|at| {
            let index = at.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b));
            if (index as usize) < vertices {
                return Ok(index);
            }
            let expected = format!("vertex indices below {vertices}");
            Err(syntax(self.file, place, expected, index.to_string()))
        })
        .collect()
    }
}

/// The bytes of each element of an accessor, which is checked to lie inside its buffer.
fn elements<'b>(
    file: &str,
    buffers: &'b [Cow<'_, [u8]>],
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
    types: &[DataType],
    place: &str,
) -> Result<impl Iterator<Item = &'b [u8]> + use<'b>, MeshError> {
    let place = format!("{place}, accessor {}", accessor.index());
    let (kind, number) = (accessor.dimensions(), accessor.data_type());
    if kind != dimensions || !types.contains(&number) {
        let expected = format!("{dimensions:?} of {types:?}");
        return Err(syntax(
            file,
            place,
            expected,
            format!("{kind:?} of {number:?}"),
        ));
    }
    let Some(view) = accessor.view().filter(|_| accessor.sparse().is_none()) else {
        return Err(syntax(
            file,
            place,
            "values in a buffer",
            "a sparse accessor",
        ));
    };
    let size = kind.multiplicity() * number.size();
    let stride = view.stride().unwrap_or(size).max(size);
    let count = accessor.count();
    let bytes = buffers.get(view.buffer().index()).and_then(|b| {
        b.get(view.offset()..)?
            .get(..view.length())?
            .get(accessor.offset()..)
    });
    let needed = count
        .checked_sub(1)
        .map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
    match (bytes, needed) {
        (Some(bytes), Some(needed)) if needed <= bytes.len() => {
            Ok((0..count).map(move |i| &bytes[i * stride..i * stride + size]))
        }
        _ => {
            let expected = format!("{count} values of {size} bytes inside their buffer view");
            Err(syntax(file, place, expected, "fewer bytes"))
        }
    }
}
