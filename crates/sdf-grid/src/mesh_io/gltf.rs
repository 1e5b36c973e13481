//! glTF 2.0, JSON (`.gltf`) and binary (`.glb`).
//!
//! The document is parsed and checked by the `gltf` crate; accessors are read here, because its
//! readers trust the offsets in the file. Every node with a mesh is a solid, placed by the
//! transforms above it, once for each of its instances; the unit is the metre. Axes are left as the
//! file has them.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use glam::{DMat4, DQuat, DVec3};
use gltf::accessor::sparse::{IndexType, Sparse};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::json::validation::Checked;
use gltf::mesh::{Mode, Semantic};
use gltf::{Accessor, Document, Gltf, Mesh, Node, Primitive};
use rustc_hash::FxHashMap;

use crate::mesh::error::MeshError;
use crate::mesh_io::content;
use crate::mesh_io::ledger::LedgerKind;
use crate::mesh_io::soup::{Soup, syntax};
use crate::mesh_io::unit::LengthUnit;
use crate::text::quoted;

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
    let least = document.as_json().asset.min_version.as_deref();
    if !version.starts_with("2.") || least.is_some_and(|least| least != "2.0") {
        let found = format!("version {}", quoted(least.unwrap_or(version)));
        return Err(syntax(file, "asset", "a glTF 2.0 file", found));
    }
    let scenes = document.scenes().count();
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let Some(scene) = scene else {
        return Err(syntax(file, "scenes", "a scene", "none"));
    };
    let numbers = Numbers {
        file,
        buffers: buffers(file, &gltf, folder)?,
    };
    let mut reader = GltfReader::new(document, numbers);
    for node in scene.nodes() {
        reader.place(&node, DMat4::IDENTITY, 0)?;
    }
    let mut soup = reader.finish();
    let reason = "the first of several, as the file names no default";
    if scenes > 1 && document.default_scene().is_none() {
        soup.ledger.add(LedgerKind::Assumed, "scene", reason);
    }
    soup.ignore("scene", "another one is read", scenes - 1);
    list(&mut soup, document);
    Ok(soup)
}

/// Counts what a document has beside meshes.
fn list(soup: &mut Soup, document: &Document) {
    for name in document.extensions_used().filter(|n| !is_read(n)) {
        let reason = "the file can be read without it";
        soup.ignore(&format!("extension {name}"), reason, 1);
    }
    let look = "it changes the look, not the solid";
    soup.ignore("material", look, document.materials().count());
    soup.ignore("texture", look, document.textures().count());
    soup.ignore(
        "camera",
        "it is no part of a solid",
        document.cameras().count(),
    );
    let animations = document.animations().count();
    soup.ignore("animation", "solids are read where they rest", animations);
}

/// The parsed document, every index in it valid.
fn checked(file: &str, bytes: &[u8]) -> Result<Gltf, MeshError> {
    let refused = |e: gltf::Error| syntax(file, "document", "a glTF 2.0 file", e.to_string());
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(refused)?;
    // The crate's validation looks this accessor up before it checks that there is one.
    let mut json = document.into_json();
    check(file, &json.extensions_required)?;
    // The crate knows only a few of those that are read here.
    json.extensions_required.clear();
    let positions = Checked::Valid(Semantic::Positions);
    for (m, mesh) in json.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let accessor = primitive.attributes.get(&positions);
            if let Some(found) = accessor.filter(|a| a.value() >= json.accessors.len()) {
                let expected = format!("one of {} accessors", json.accessors.len());
                let place = format!("mesh {m}, POSITION");
                return Err(syntax(file, place, expected, found.value().to_string()));
            }
            let bare = accessor.and_then(|a| json.accessors.get(a.value()));
            let bare = bare.is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none());
            let others = primitive.extensions.as_ref().map(|e| &e.others);
            if bare && others.is_some_and(|others| others.contains_key(DRACO)) {
                let place = format!("mesh {m}, POSITION");
                let (expected, found) = (UNCOMPRESSED, DRACO);
                return Err(syntax(file, place, expected, found));
            }
        }
    }
    let document = Document::from_json(json).map_err(refused)?;
    Ok(Gltf { document, blob })
}

/// Nodes below one another; deeper trees are refused.
const DEEPEST: usize = 1000;

/// Kinds of numbers that coordinates may be.
const EXACT: [DataType; 1] = [DataType::F32];
const COARSE: [DataType; 5] = [
    DataType::F32,
    DataType::I8,
    DataType::U8,
    DataType::I16,
    DataType::U16,
];

struct GltfReader<'a> {
    document: &'a Document,
    numbers: Numbers<'a>,
    soup: Soup,
    /// Nodes seen: each may be placed once only.
    visited: Vec<bool>,
    /// Kinds of numbers that positions may be.
    positions: &'static [DataType],
}

impl<'a> GltfReader<'a> {
    fn new(document: &'a Document, numbers: Numbers<'a>) -> Self {
        let quantized = document.extensions_used().any(|name| name == QUANTIZED);
        Self {
            document,
            numbers,
            soup: Soup {
                unit: Some(LengthUnit::M),
                ..Soup::default()
            },
            visited: vec![false; document.nodes().len()],
            positions: if quantized { &COARSE } else { &EXACT },
        }
    }

    fn finish(mut self) -> Soup {
        let left = self.visited.iter().filter(|seen| !**seen).count();
        self.soup.ignore("node", "it is not in the scene", left);
        self.soup
    }

    /// Adds the meshes of a node and of those below it.
    fn place(&mut self, node: &Node<'_>, above: DMat4, depth: usize) -> Result<(), MeshError> {
        let (file, place) = (self.numbers.file, format!("node {}", node.index()));
        if std::mem::replace(&mut self.visited[node.index()], true) {
            return Err(syntax(file, place, "one place in the tree", "several"));
        }
        if depth > DEEPEST {
            let expected = format!("at most {DEEPEST} nodes above it");
            return Err(syntax(file, place, expected, "more"));
        }
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        let transform = above * DMat4::from_cols_array_2d(&columns);
        if let Some(mesh) = node.mesh() {
            let instances = self.instances(node, &place)?;
            if instances.len() > 1 || node.extension_value(INSTANCES).is_some() {
                self.soup.read("instance", instances.len());
            }
            for instance in instances {
                self.add_solid(node, &mesh, transform * instance)?;
            }
        }
        node.children()
            .try_for_each(|child| self.place(&child, transform, depth + 1))
    }

    /// Where a node's mesh is in its frame: once, unless the node lists instances.
    fn instances(&mut self, node: &Node<'_>, place: &str) -> Result<Vec<DMat4>, MeshError> {
        let Some(extension) = node.extension_value(INSTANCES) else {
            return Ok(vec![DMat4::IDENTITY]);
        };
        let place = format!("{place}, {INSTANCES}");
        let file = self.numbers.file;
        let attributes = extension.get("attributes").and_then(|a| a.as_object());
        let mut count = None;
        let mut find = |name: &str| -> Result<Option<Accessor<'a>>, MeshError> {
            let Some(index) = attributes.and_then(|a| a.get(name)) else {
                return Ok(None);
            };
            let index = index.as_u64().and_then(|i| usize::try_from(i).ok());
            let accessor = index.and_then(|i| self.document.accessors().nth(i));
            let Some(accessor) = accessor else {
                return Err(syntax(
                    file,
                    &place,
                    format!("an accessor as {name}"),
                    "none",
                ));
            };
            let expected = *count.get_or_insert(accessor.count());
            if accessor.count() != expected {
                let expected = format!("{expected} values of {name}");
                let found = accessor.count().to_string();
                return Err(syntax(file, &place, expected, found));
            }
            Ok(Some(accessor))
        };
        let (at, turned, sized) = (find("TRANSLATION")?, find("ROTATION")?, find("SCALE")?);
        let count = count.unwrap_or(0);
        self.soup.check_room(file, count)?;
        let turns = [DataType::F32, DataType::I8, DataType::I16];
        let at = at.map(|a| self.numbers.vectors::<3>(&a, &EXACT, &place));
        let turned = turned.map(|a| self.numbers.vectors::<4>(&a, &turns, &place));
        let sized = sized.map(|a| self.numbers.vectors::<3>(&a, &EXACT, &place));
        let (at, turned, sized) = (at.transpose()?, turned.transpose()?, sized.transpose()?);
        let instance = |i: usize| {
            let at = at.as_ref().map_or(DVec3::ZERO, |v| DVec3::from_array(v[i]));
            let turn = turned.as_ref().map_or(DQuat::IDENTITY, |v| {
                let length = v[i].iter().map(|x| x * x).sum::<f64>().sqrt();
                DQuat::from_array(v[i].map(|x| x / length))
            });
            let size = sized
                .as_ref()
                .map_or(DVec3::ONE, |v| DVec3::from_array(v[i]));
            DMat4::from_scale_rotation_translation(size, turn, at)
        };
        Ok((0..count).map(instance).collect())
    }

    fn add_solid(
        &mut self,
        node: &Node<'_>,
        mesh: &Mesh<'_>,
        transform: DMat4,
    ) -> Result<(), MeshError> {
        let name = node.name().or(mesh.name()).unwrap_or_default();
        let solid = self.soup.begin_solid(name);
        self.soup.read("mesh", 1);
        for primitive in mesh.primitives() {
            let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            self.add(&primitive, transform, &place)?;
        }
        let mut record_loss = |item: &str, reason: &str| {
            let place = format!("node {} {}", node.index(), quoted(name));
            self.soup
                .record_loss(Some(solid..solid + 1), place, item, reason);
        };
        if node.skin().is_some() {
            record_loss("a skin", "joints move the vertices");
        }
        let weights = node.weights().or(mesh.weights()).unwrap_or_default();
        if weights.iter().any(|w| *w != 0.0) {
            record_loss("morph targets with weights", "they move the vertices");
        } else {
            let targets = mesh.primitives().map(|p| p.morph_targets().count()).sum();
            self.soup
                .ignore("morph target", "its weight is zero", targets);
        }
        Ok(())
    }

    /// Adds a primitive; points and lines say nothing about the solid.
    fn add(
        &mut self,
        primitive: &Primitive<'_>,
        transform: DMat4,
        place: &str,
    ) -> Result<(), MeshError> {
        let file = self.numbers.file;
        let mode = primitive.mode();
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            let item = match mode {
                Mode::Points => "primitive of points",
                _ => "primitive of lines",
            };
            self.soup.ignore(item, "it encloses no volume", 1);
            return Ok(());
        }
        for (semantic, _) in primitive.attributes() {
            if semantic != Semantic::Positions {
                let item = format!("attribute {}", semantic.to_string());
                let reason = "it does not say where the surface is";
                self.soup.ignore(&item, reason, 1);
            }
        }
        let positions = primitive
            .get(&Semantic::Positions)
            .ok_or_else(|| syntax(file, place, "positions", "none"))?;
        self.soup.check_room(file, positions.count())?;
        let (first, count) = (self.soup.vertices.len() as u32, positions.count());
        let found = self
            .numbers
            .vectors::<3>(&positions, self.positions, place)?;
        let placed = found
            .into_iter()
            .map(|p| transform.transform_point3(p.into()));
        self.soup.vertices.extend(placed);
        let indices = match primitive.indices() {
            Some(accessor) => self.numbers.indices(&accessor, count, place)?,
            None => (0..count as u32).collect(),
        };
        let mirrored = transform.determinant() < 0.0;
        let before = self.soup.triangles.len();
        for corners in triangles(mode, &indices) {
            let [a, b, c] = corners.map(|i| first + i);
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.soup.triangles.push(corners);
        }
        let added = self.soup.triangles.len() - before;
        self.soup.read("triangle", added);
        self.soup.check_room(file, added)
    }
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

/// Most values of an accessor that has no buffer: they are zeros that no byte of the file backs.
const MOST_ZEROS: usize = 1 << 22;

/// Bytes of the largest element read: four single-precision numbers.
const LARGEST: usize = 16;

/// A zero of any kind.
const ZEROS: &[u8] = &[0; LARGEST];

/// The bytes of a document's buffers, and the name of the file for errors.
struct Numbers<'a> {
    file: &'a str,
    buffers: Vec<Cow<'a, [u8]>>,
}

impl Numbers<'_> {
    /// The vectors of an accessor, as numbers. Whole numbers are read as they are, or, if the
    /// accessor says `normalized`, as fractions of the largest.
    fn vectors<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        types: &[DataType],
        place: &str,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        let shape = if N == 4 {
            Dimensions::Vec4
        } else {
            Dimensions::Vec3
        };
        let (kind, normalized) = (accessor.data_type(), accessor.normalized());
        let size = kind.size();
        let vector = |at: &[u8]| -> [f64; N] {
            std::array::from_fn(|k| number(&at[k * size..], kind, normalized))
        };
        let elements = self.elements(accessor, shape, types, place)?;
        Ok(elements.map(vector).collect())
    }

    /// Indices, each below `limit`.
    fn indices(
        &self,
        accessor: &Accessor<'_>,
        limit: usize,
        place: &str,
    ) -> Result<Vec<u32>, MeshError> {
        let types = [DataType::U8, DataType::U16, DataType::U32];
        let elements = self.elements(accessor, Dimensions::Scalar, &types, place)?;
        let checked = elements.map(|at| {
            let index = whole(at);
            if (index as usize) < limit {
                return Ok(index);
            }
            let expected = format!("vertex indices below {limit}");
            Err(syntax(self.file, place, expected, index.to_string()))
        });
        checked.collect()
    }

    /// The bytes of each element of an accessor, which is checked to lie inside its buffer.
    fn elements<'b>(
        &'b self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        types: &[DataType],
        place: &str,
    ) -> Result<impl Iterator<Item = &'b [u8]> + use<'b>, MeshError> {
        let place = format!("{place}, accessor {}", accessor.index());
        let (kind, number) = (accessor.dimensions(), accessor.data_type());
        if kind != dimensions || !types.contains(&number) {
            let words: Vec<&str> = types.iter().map(|t| type_name(*t)).collect();
            let expected = format!("{} of {}", shape_name(dimensions), words.join(" or "));
            let found = format!("{} of {}", shape_name(kind), type_name(number));
            return Err(syntax(self.file, place, expected, found));
        }
        let (count, size) = (accessor.count(), kind.multiplicity() * number.size());
        let (base, stride) = match accessor.view() {
            Some(view) => {
                let stride = view.stride().unwrap_or(size).max(size);
                let offset = accessor.offset();
                let base = self.strided(&view, offset, stride, size, count, &place)?;
                (Some(base), stride)
            }
            None if count > MOST_ZEROS => {
                let expected = format!("at most {MOST_ZEROS} values without a buffer view");
                return Err(syntax(self.file, place, expected, count.to_string()));
            }
            None => (None, size),
        };
        let mut replaced: FxHashMap<usize, &'b [u8]> = FxHashMap::default();
        if let Some(sparse) = accessor.sparse() {
            replaced = self.replaced(&sparse, size, &place)?;
        }
        Ok((0..count).map(move |i| {
            let of_base = || match base {
                Some(bytes) => &bytes[i * stride..i * stride + size],
                None => &ZEROS[..size],
            };
            replaced.get(&i).copied().unwrap_or_else(of_base)
        }))
    }

    /// The elements that a sparse accessor has others in place of.
    fn replaced<'b>(
        &'b self,
        sparse: &Sparse<'_>,
        size: usize,
        place: &str,
    ) -> Result<FxHashMap<usize, &'b [u8]>, MeshError> {
        let (count, indices, values) = (sparse.count(), sparse.indices(), sparse.values());
        let wide = match indices.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let place = format!("{place}, sparse");
        let (view, offset) = (indices.view(), indices.offset());
        let at = self.strided(&view, offset, wide, wide, count, &place)?;
        let (view, offset) = (values.view(), values.offset());
        let with = self.strided(&view, offset, size, size, count, &place)?;
        let pair = |i: usize| {
            let index = whole(&at[i * wide..(i + 1) * wide]) as usize;
            (index, &with[i * size..(i + 1) * size])
        };
        Ok((0..count).map(pair).collect())
    }

    /// The bytes of a view from an offset on, with room for the given number of elements.
    fn strided<'b>(
        &'b self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
        place: &str,
    ) -> Result<&'b [u8], MeshError> {
        let buffer = self.buffers.get(view.buffer().index());
        let bytes =
            buffer.and_then(|b| b.get(view.offset()..)?.get(..view.length())?.get(offset..));
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        match (bytes, needed) {
            (Some(bytes), Some(needed)) if needed <= bytes.len() => Ok(bytes),
            _ => {
                let expected = format!("{count} values of {size} bytes inside their buffer view");
                Err(syntax(self.file, place, expected, "fewer bytes"))
            }
        }
    }
}

/// An unsigned whole number, its low byte first.
fn whole(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b))
}

/// The number at the start of bytes.
fn number(bytes: &[u8], kind: DataType, normalized: bool) -> f64 {
    let unsigned = whole(&bytes[..kind.size()]);
    let (value, most) = match kind {
        DataType::I8 => (f64::from(unsigned as u8 as i8), 127.0),
        DataType::U8 => (f64::from(unsigned), 255.0),
        DataType::I16 => (f64::from(unsigned as u16 as i16), 32767.0),
        DataType::U16 => (f64::from(unsigned), 65535.0),
        DataType::U32 => (f64::from(unsigned), f64::from(u32::MAX)),
        DataType::F32 => return f64::from(f32::from_bits(unsigned)),
    };
    match normalized {
        true => (value / most).max(-1.0),
        false => value,
    }
}

/// How buffers may be compressed. Buffers that only stand in for compressed ones are empty.
const COMPRESSED: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

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
            let stands_in = |name: &&str| buffer.extension_value(name).is_some();
            if data.is_empty() && COMPRESSED.iter().any(stands_in) {
                return Ok(data);
            }
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
        Some(folder) if beside => content::read_whole(&folder.join(name)),
        _ => {
            let expected = "a buffer in the file or in one beside it";
            Err(syntax(file, place, expected, quoted(uri)))
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

/// Coordinates as whole numbers.
const QUANTIZED: &str = "KHR_mesh_quantization";

/// A mesh in many places.
const INSTANCES: &str = "EXT_mesh_gpu_instancing";

/// The expected alternative to a compressed mesh.
const UNCOMPRESSED: &str = "a mesh that is not compressed (export it without compression)";

/// Compressed meshes and buffers.
const DRACO: &str = "KHR_draco_mesh_compression";
const COMPRESSION: [&str; 4] = [
    DRACO,
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_mesh_compression_meshopt",
];

/// Beginnings of the names of extensions that change no solid.
const LOOKS: [&str; 12] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "EXT_materials_",
    "ADOBE_materials_",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "KHR_audio",
];

/// Whether what an extension adds is read here.
fn is_read(name: &str) -> bool {
    [QUANTIZED, INSTANCES].contains(&name)
}

/// Refuses a file that cannot be read without an extension that is not read here.
fn check(file: &str, required: &[String]) -> Result<(), MeshError> {
    let looks = |name: &str| LOOKS.iter().any(|look| name.starts_with(look));
    let unknown = required.iter().find(|name| !is_read(name) && !looks(name));
    let Some(name) = unknown else { return Ok(()) };
    let expected = match COMPRESSION.contains(&name.as_str()) {
        true => UNCOMPRESSED.to_owned(),
        false => format!("no other extension that changes solids than {QUANTIZED} and {INSTANCES}"),
    };
    Err(syntax(file, "extensionsRequired", expected, name))
}

/// As the format names it.
fn shape_name(dimensions: Dimensions) -> &'static str {
    match dimensions {
        Dimensions::Scalar => "SCALAR",
        Dimensions::Vec2 => "VEC2",
        Dimensions::Vec3 => "VEC3",
        Dimensions::Vec4 => "VEC4",
        Dimensions::Mat2 => "MAT2",
        Dimensions::Mat3 => "MAT3",
        Dimensions::Mat4 => "MAT4",
    }
}

/// As the format names it.
fn type_name(number: DataType) -> &'static str {
    match number {
        DataType::I8 => "BYTE",
        DataType::U8 => "UNSIGNED_BYTE",
        DataType::I16 => "SHORT",
        DataType::U16 => "UNSIGNED_SHORT",
        DataType::U32 => "UNSIGNED_INT",
        DataType::F32 => "FLOAT",
    }
}
