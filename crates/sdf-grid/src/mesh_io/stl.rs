//! STL, binary and ASCII.
//!
//! Read here rather than through a library because the one there is stops at the first of several
//! ASCII solids and trusts the count in a binary header. Normals are ignored: repair orients.

use glam::{DVec3, Vec3};

use super::soup::{Soup, syntax};
use super::{content, parts};
use crate::mesh::error::MeshError;
use crate::text::quoted;

/// Bytes before the facets of a binary file: a free text and the number of facets.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal, three corners, attribute.
const FACET: usize = 50;

/// How far a binary file is searched for the zero bytes that no text has.
const PEEK: usize = 512;

/// Reads all solids of an STL file as loose triangles; each closed body is a solid if the file
/// tells none apart.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut soup = read(file, bytes)?;
    parts::join_open(&mut soup, "solid");
    parts::divide_bodies(&mut soup);
    Ok(soup)
}

/// Reads the solids that an STL file itself tells apart.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut soup = if is_text(bytes) {
        parse_ascii(file, bytes)
    } else {
        parse_binary(file, bytes)
    }?;
    let facets = soup.triangles.len();
    soup.read("facet", facets);
    soup.ignore("normal", "faces are oriented by their corners", facets);
    Ok(soup)
}

/// Binary files may start with "solid" too, but ASCII ones have no zero byte and never the size
/// that a binary header in their place would ask for.
fn is_text(bytes: &[u8]) -> bool {
    let word = bytes.trim_ascii_start().get(..5).unwrap_or_default();
    word.eq_ignore_ascii_case(b"solid")
        && stated_size(bytes) != Some(bytes.len() as u64)
        && !bytes[..bytes.len().min(PEEK)].contains(&0)
}

/// The size that a binary header says the file has.
fn stated_size(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER - 4..)?.first_chunk::<4>()?;
    Some(HEADER as u64 + FACET as u64 * u64::from(u32::from_le_bytes(*count)))
}

/// One solid after another, as files joined end to end hold them.
fn parse_binary(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut soup = Soup::default();
    let (mut rest, mut coloured) = (bytes, 0);
    loop {
        let at = bytes.len() - rest.len();
        let (facets, after) = split_binary(file, rest, at)?;
        soup.begin_solid("");
        for facet in facets {
            let (numbers, attribute) = facet.as_chunks::<4>();
            let corner = |k: usize| {
                let at = [3 * k, 3 * k + 1, 3 * k + 2];
                let [x, y, z] = at.map(|i| f32::from_le_bytes(numbers[i]));
                Vec3::new(x, y, z).as_dvec3()
            };
            push(&mut soup, [corner(1), corner(2), corner(3)]);
            coloured += usize::from(attribute != [0, 0]);
        }
        rest = after;
        if !goes_on(rest) {
            break;
        }
    }
    soup.ignore("attribute", "it changes the look, not the solid", coloured);
    // Some programs append a few bytes or fill a file up; more may be facets.
    let reason = "it comes after the facets that the header counts";
    let room = rest.len().is_multiple_of(FACET) || rest.len() >= HEADER + FACET;
    if room && rest.iter().any(|&b| b != 0) {
        let place = format!("byte {}", bytes.len() - rest.len());
        let found = format!("{} bytes with room for facets", rest.len());
        soup.record_loss(None, place, &found, reason);
    } else {
        soup.ignore("trailing byte", reason, rest.len());
    }
    Ok(soup)
}

/// Whether bytes after a binary solid are another one, or several, with at most a few more bytes.
fn goes_on(rest: &[u8]) -> bool {
    let next = stated_size(rest).filter(|&size| size > HEADER as u64);
    let next = next.and_then(|size| rest.get(usize::try_from(size).ok()?..));
    let filled = |next: &[u8]| next.len() < HEADER || next.iter().all(|&b| b == 0);
    next.is_some_and(|next| filled(next) || goes_on(next))
}

/// The facets of the binary solid at the start of `bytes`, which is byte `at` of the file, and what
/// follows it.
fn split_binary<'a>(
    file: &str,
    bytes: &'a [u8],
    at: usize,
) -> Result<(&'a [[u8; FACET]], &'a [u8]), MeshError> {
    let found = bytes.len() as u64;
    let stated = stated_size(bytes).ok_or_else(|| {
        let expected = format!("\"solid\" or a binary header of {HEADER} bytes");
        syntax(file, "start", expected, format!("{found} bytes"))
    })?;
    if stated > found {
        let facets = (stated - HEADER as u64) / FACET as u64;
        let expected = format!("{facets} facets in {stated} bytes");
        let place = format!("byte {}", at + HEADER - 4);
        return Err(syntax(file, place, expected, format!("{found} bytes")));
    }
    let (facets, rest) = bytes[HEADER..].split_at(stated as usize - HEADER);
    Ok((facets.as_chunks().0, rest))
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
    for (index, line) in content::lines(bytes).enumerate() {
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
                return Err(syntax(file, place(), expected, quoted(word)));
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
            let found = quoted(&words.join(" "));
            syntax(file, place(), "vertex with 3 numbers", found)
        })
}
