//! STL, binary and ASCII.
//!
//! Read here rather than through a library because the one there is stops at the first of several
//! ASCII solids and trusts the count in a binary header. Normals are ignored: hygiene orients.

use glam::{DVec3, Vec3};

use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;

/// Bytes before the facets of a binary file: a free text and the number of facets.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal, three corners, attribute.
const FACET: usize = 50;

/// How far a binary file is searched for the zero bytes that no text has.
const PEEK: usize = 512;

/// Reads all solids of an STL file as loose triangles.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    if is_text(bytes) {
        parse_ascii(file, bytes)
    } else {
        parse_binary(file, bytes)
    }
}

/// Binary files may start with "solid" too, but ASCII ones have no zero byte and never the size
/// that a binary header in their place would ask for.
fn is_text(bytes: &[u8]) -> bool {
    let start = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let word = start.trim_ascii_start().get(..5).unwrap_or_default();
    word.eq_ignore_ascii_case(b"solid")
        && stated_size(bytes) != Some(bytes.len() as u64)
        && !bytes[..bytes.len().min(PEEK)].contains(&0)
}

/// The size that a binary header says the file has.
fn stated_size(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER - 4..)?.first_chunk::<4>()?;
    Some(HEADER as u64 + FACET as u64 * u64::from(u32::from_le_bytes(*count)))
}

fn parse_binary(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let found = bytes.len() as u64;
    let stated = stated_size(bytes).ok_or_else(|| {
        let expected = format!("\"solid\" or a binary header of {HEADER} bytes");
        syntax(file, "start", expected, format!("{found} bytes"))
    })?;
    // Some programs append data of their own.
    if stated > found {
        let facets = (stated - HEADER as u64) / FACET as u64;
        let expected = format!("{facets} facets in {stated} bytes");
        return Err(syntax(file, "byte 80", expected, format!("{found} bytes")));
    }
    let (facets, _) = bytes[HEADER..stated as usize].as_chunks::<FACET>();
    let mut soup = Soup::default();
    soup.begin_solid("");
    for facet in facets {
        let (numbers, _) = facet.as_chunks::<4>();
        let corner = |k: usize| {
            let [x, y, z] = [3 * k, 3 * k + 1, 3 * k + 2].map(|i| f32::from_le_bytes(numbers[i]));
            Vec3::new(x, y, z).as_dvec3()
        };
        push(&mut soup, [corner(1), corner(2), corner(3)]);
    }
    Ok(soup)
}

fn push(soup: &mut Soup, corners: [DVec3; 3]) {
    let first = soup.vertices.len() as u32;
    soup.vertices.extend(corners);
    soup.triangles.push([first, first + 1, first + 2]);
}

/// Solids, facets and loops are only checked as far as they decide which corners belong together.
fn parse_ascii(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut soup = Soup::default();
    let mut corners = Vec::with_capacity(3);
    let mut open_solid = None;
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    for (index, line) in lines(bytes).enumerate() {
        let place = || format!("line {}", index + 1);
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_whitespace();
        match words.next().map(str::to_lowercase).as_deref() {
            None | Some("facet" | "endfacet" | "outer") => {}
            Some("solid") => {
                soup.begin_solid(text.trim()[5..].trim());
                open_solid = Some(index + 1);
            }
            Some("endsolid") => open_solid = None,
            Some("vertex") => corners.push(vertex(file, place, words)?),
            Some("endloop") => {
                let loop_corners: [DVec3; 3] = corners.as_slice().try_into().map_err(|_| {
                    let found = format!("{}", corners.len());
                    syntax(file, place(), "a loop of 3 vertices", found)
                })?;
                push(&mut soup, loop_corners);
                corners.clear();
            }
            Some(word) => {
                let expected = "solid, facet, outer loop, vertex or an end of these";
                return Err(syntax(file, place(), expected, format!("{word:?}")));
            }
        }
    }
    match open_solid {
        Some(line) => {
            let expected = format!("endsolid for the solid of line {line}");
            Err(syntax(file, "end of file", expected, "nothing"))
        }
        None => Ok(soup),
    }
}

/// Lines that end as on Unix, DOS or an old Macintosh.
fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    bytes.split(move |&b| b == end)
}

fn vertex<'a>(
    file: &str,
    place: impl Fn() -> String,
    words: impl Iterator<Item = &'a str>,
) -> Result<DVec3, MeshError> {
    let words: Vec<&str> = words.collect();
    let numbers: Option<Vec<f64>> = words.iter().map(|w| w.parse().ok()).collect();
    numbers
        .and_then(|n| <[f64; 3]>::try_from(n).ok())
        .map(DVec3::from_array)
        .ok_or_else(|| {
            let found = format!("{:?}", words.join(" "));
            syntax(file, place(), "vertex with 3 numbers", found)
        })
}
