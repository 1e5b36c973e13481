//! The bytes of a document's buffers.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use gltf::buffer::Source;
use gltf::{Document, Gltf};

use crate::mesh::error::MeshError;
use crate::mesh_io::bytes;
use crate::mesh_io::soup::syntax;

/// How buffers may be compressed. Buffers that only stand in for compressed ones are empty.
const COMPRESSED: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The bytes of every buffer: the binary chunk, `data:` text, or files in `folder`.
pub(super) fn buffers<'a>(
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
