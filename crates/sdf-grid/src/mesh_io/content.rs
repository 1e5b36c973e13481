//! The content of a file before its format matters: text in some encoding, or something that is no
//! mesh despite its name.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::ledger::{Ledger, LedgerKind};
use crate::mesh::error::MeshError;

/// Bytes at the start that are inspected.
pub(super) const PEEK: usize = 1024;

const UTF8_MARK: &[u8] = b"\xEF\xBB\xBF";

/// First bytes of files that are no meshes, their kind, and a remedy.
const STARTS: [(&[u8], &str, &str); 13] = [
    (b"version https://git-lfs", LFS, PULL),
    (b"version https://hawser", LFS, PULL),
    (b"version http://git-media", LFS, PULL),
    (b"/annex/objects/", "a git-annex pointer", ANNEX),
    (b"PK\x03\x04", "a zip archive", UNPACK),
    (b"\x1f\x8b", "a gzip archive", UNPACK),
    (b"BZh", "a bzip2 archive", UNPACK),
    (b"\xFD7zXZ\0", "an xz archive", UNPACK),
    (b"7z\xBC\xAF\x27\x1C", "a 7-Zip archive", UNPACK),
    (b"\x28\xB5\x2F\xFD", "a Zstandard archive", UNPACK),
    (b"%PDF-", "a PDF document", DOWNLOAD),
    (b"\x89PNG\r\n", "a PNG picture", DOWNLOAD),
    (b"\xFF\xD8\xFF", "a JPEG picture", DOWNLOAD),
];

/// Beginnings of formats that are read, and the format each belongs to.
const FORMATS: [(&[u8], &str, &[ExpectedFormat]); 6] = [
    (
        b"glTF\x02\0\0\0",
        "a binary glTF file",
        &[ExpectedFormat::Gltf],
    ),
    (b"ply\n", "a PLY file", &[ExpectedFormat::Ply]),
    (b"ply\r", "a PLY file", &[ExpectedFormat::Ply]),
    (b"ISO-10303-21;", "a STEP file", &[ExpectedFormat::Step]),
    (b"solid ", "an ASCII STL file", &[ExpectedFormat::Stl]),
    // Scalable vector graphics, replies of servers.
    (b"<?xml", "an XML document", &[]),
];

const LFS: &str = "a Git LFS pointer";
const PULL: &str = "it stands for the file, which `git lfs pull` fetches";
const ANNEX: &str = "it stands for the file, which `git annex get` fetches";
const UNPACK: &str = "unpack it, and read the mesh file in it";
const DOWNLOAD: &str = "export or download the mesh file again";
const PAGE: &str = "the download gave a page about the file; download the file itself (on GitHub, \
                    \"Download raw file\")";
const RENAME: &str = "rename it so that its name ends as files of its format do";
const EXPORT: &str = "export it as text in this format";
const ENCODE: &str = "save it as UTF-8";

/// The content that the name of a file promises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExpectedFormat {
    Obj,
    Stl,
    Ply,
    Gltf,
    ThreeMf,
    Step,
}

impl ExpectedFormat {
    fn name(self) -> &'static str {
        match self {
            Self::Obj => "an OBJ file",
            Self::Stl => "an STL file",
            Self::Ply => "a PLY file",
            Self::Gltf => "a glTF file",
            Self::ThreeMf => "a 3MF file",
            Self::Step => "a STEP file",
        }
    }
}

impl From<MeshFormat> for ExpectedFormat {
    fn from(format: MeshFormat) -> Self {
        match format {
            MeshFormat::Obj => Self::Obj,
            MeshFormat::Stl => Self::Stl,
            MeshFormat::Ply => Self::Ply,
            MeshFormat::Gltf => Self::Gltf,
            MeshFormat::ThreeMf => Self::ThreeMf,
        }
    }
}

/// The bytes to parse: text as UTF-8 without a byte order mark, anything else as it is. What is no
/// mesh file is refused by its name.
pub(super) fn prepare<'a>(
    file: &str,
    bytes: &'a [u8],
    expected: ExpectedFormat,
    ledger: &mut Ledger,
) -> Result<Cow<'a, [u8]>, MeshError> {
    let text = match utf16(bytes) {
        Some(big) => {
            let reason = "UTF-16, as its first bytes say";
            ledger.add(LedgerKind::Assumed, "text encoding", reason);
            Cow::Owned(from_utf16(bytes, big))
        }
        None => Cow::Borrowed(bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)),
    };
    check(file, &text, expected)?;
    if expected == ExpectedFormat::Obj && text.iter().take(PEEK).any(|&b| b == 0) {
        return Err(foreign(file, expected, "binary data", EXPORT));
    }
    Ok(text)
}

/// Refuses what is no STEP file by its name; STEP is read by other programs, which know no UTF-16.
pub(super) fn check_step(file: &str, start: &[u8]) -> Result<(), MeshError> {
    let expected = ExpectedFormat::Step;
    if let Some(big) = utf16(start) {
        check(file, &from_utf16(start, big), expected)?;
        return Err(foreign(file, expected, "UTF-16 text", ENCODE));
    }
    check(
        file,
        start.strip_prefix(UTF8_MARK).unwrap_or(start),
        expected,
    )
}

fn foreign(
    file: &str,
    expected: ExpectedFormat,
    found: impl Into<String>,
    help: &'static str,
) -> MeshError {
    MeshError::Foreign {
        file: file.to_owned(),
        expected: expected.name(),
        found: found.into(),
        help,
    }
}

/// Refuses what has only the name of a mesh file, or of one in this format.
fn check(file: &str, bytes: &[u8], expected: ExpectedFormat) -> Result<(), MeshError> {
    let start = bytes[..bytes.len().min(PEEK)].trim_ascii_start();
    if start.is_empty() && bytes.len() < PEEK {
        return Err(foreign(file, expected, "an empty file", DOWNLOAD));
    }
    if is_page(start) {
        return Err(foreign(file, expected, "an HTML page", PAGE));
    }
    let archive = expected == ExpectedFormat::ThreeMf;
    let known = STARTS.iter().find(|(mark, ..)| start.starts_with(mark));
    if let Some(&(mark, found, help)) = known
        && !(archive && mark == b"PK\x03\x04")
    {
        return Err(foreign(file, expected, found, help));
    }
    let other = FORMATS.iter().find(|(mark, ..)| start.starts_with(mark));
    match other {
        // An STL file of any other kind may begin with anything.
        Some((.., owners)) if owners.contains(&expected) => Ok(()),
        Some(&(_, found, _)) => Err(foreign(file, expected, found, RENAME)),
        None => Ok(()),
    }
}

/// Whether text is the beginning of a page for a browser.
fn is_page(start: &[u8]) -> bool {
    let lower = start.to_ascii_lowercase();
    let has = |tag: &[u8]| lower.windows(tag.len()).any(|w| w == tag);
    let opens = |tag: &&[u8]| lower.starts_with(tag);
    let tags: [&[u8]; 5] = [b"<!doctype html", b"<html", b"<head", b"<body", b"<script"];
    tags.iter().any(opens) || (lower.starts_with(b"<") && (has(b"<html") || has(b"<!doctype html")))
}

/// Whether bytes are UTF-16 text: `Some(true)` if the high byte of each unit comes first. Without a
/// byte order mark, the zero bytes beside the first letters tell.
pub(super) fn utf16(bytes: &[u8]) -> Option<bool> {
    match *bytes {
        [0xFE, 0xFF, ..] => return Some(true),
        [0xFF, 0xFE, ..] => return Some(false),
        _ => {}
    }
    let (pairs, _) = bytes[..bytes.len().min(64)].as_chunks::<2>();
    let zeros = |side: usize| pairs.iter().filter(|pair| pair[side] == 0).count();
    let most = pairs.len() >= 4 && 4 * zeros(0).max(zeros(1)) >= 3 * pairs.len();
    match (zeros(0), zeros(1)) {
        (0, _) if most => Some(false),
        (_, 0) if most => Some(true),
        _ => None,
    }
}

/// UTF-16 text as UTF-8 without a byte order mark; what is none becomes a replacement character.
pub(super) fn from_utf16(bytes: &[u8], big: bool) -> Vec<u8> {
    let (units, _) = bytes.as_chunks::<2>();
    let unit = |&pair: &[u8; 2]| match big {
        true => u16::from_be_bytes(pair),
        false => u16::from_le_bytes(pair),
    };
    let text = char::decode_utf16(units.iter().map(unit));
    let text = text.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    text.skip_while(|&c| c == '\u{feff}')
        .collect::<String>()
        .into_bytes()
}

/// Lines that end as on Unix, DOS or an old Macintosh, also within one file.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = Some(bytes);
    std::iter::from_fn(move || {
        let text = rest?;
        let Some(end) = text.iter().position(|b| matches!(b, b'\n' | b'\r')) else {
            rest = None;
            return Some(text);
        };
        let wide = text[end..].starts_with(b"\r\n");
        rest = Some(&text[end + 1 + usize::from(wide)..]);
        Some(&text[..end])
    })
}

/// The bytes of a file.
pub(super) fn read_whole(path: &Path) -> Result<Vec<u8>, MeshError> {
    read_start(path, usize::MAX)
}

/// The first bytes of a file, at most `most`.
pub(super) fn read_start(path: &Path, most: usize) -> Result<Vec<u8>, MeshError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|f| f.take(most as u64).read_to_end(&mut bytes))
        .map_err(|source| MeshError::Read {
            path: path.to_owned(),
            source,
        })?;
    Ok(bytes)
}

/// A mesh format that is read from bytes alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// STL, binary or ASCII.
    Stl,
    /// PLY, binary or ASCII.
    Ply,
    /// glTF 2.0, JSON or binary.
    Gltf,
    /// 3D Manufacturing Format.
    ThreeMf,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_three_ways() {
        let found: Vec<&[u8]> = lines(b"a\nb\r\nc\rd\n\re").collect();
        let expected: [&[u8]; 6] = [b"a", b"b", b"c", b"d", b"", b"e"];
        assert_eq!(found, expected);
    }

    #[test]
    fn utf16_is_told_by_its_mark_or_its_zeros() {
        let text = "v 0 0 ü𝄞";
        for big in [false, true] {
            let units = text.encode_utf16();
            let plain: Vec<u8> = units
                .flat_map(|u| {
                    if big {
                        u.to_be_bytes()
                    } else {
                        u.to_le_bytes()
                    }
                })
                .collect();
            let mark: [u8; 2] = if big { [0xFE, 0xFF] } else { [0xFF, 0xFE] };
            for bytes in [plain.clone(), [&mark[..], &plain].concat()] {
                assert_eq!(utf16(&bytes), Some(big));
                assert_eq!(from_utf16(&bytes, big), text.as_bytes());
            }
        }
        assert_eq!(utf16(b"solid x"), None);
        assert_eq!(utf16(&[0; 84]), None);
    }
}
