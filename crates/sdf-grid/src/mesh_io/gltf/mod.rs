//! glTF 2.0, JSON (`.gltf`) and binary (`.glb`).
//!
//! The document is parsed and checked by the `gltf` crate; accessors are read here, because its
//! readers trust the offsets in the file. Every node with a mesh is a solid, placed by the
//! transforms above it, once for each of its instances; the unit is the metre. Axes are left as the
//! file has them.

mod accessor;
mod buffers;
mod extensions;
mod reader;

use std::path::Path;

use glam::DMat4;
use gltf::json::validation::Checked;
use gltf::mesh::Semantic;
use gltf::{Document, Gltf};

use super::ledger::LedgerKind;
use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;
use accessor::Numbers;
use reader::GltfReader;

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
        let found = format!("version {:?}", least.unwrap_or(version));
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
        buffers: buffers::buffers(file, &gltf, folder)?,
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
    for name in document
        .extensions_used()
        .filter(|n| !extensions::is_read(n))
    {
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
    extensions::check(file, &json.extensions_required)?;
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
            if bare && others.is_some_and(|others| others.contains_key(extensions::DRACO)) {
                let place = format!("mesh {m}, POSITION");
                let (expected, found) = (extensions::UNCOMPRESSED, extensions::DRACO);
                return Err(syntax(file, place, expected, found));
            }
        }
    }
    let document = Document::from_json(json).map_err(refused)?;
    Ok(Gltf { document, blob })
}
