//! Wavefront OBJ: positions and faces, in double precision, errors with line numbers.
//!
//! Read here rather than through a library because the ones there are round to single precision
//! or cannot say which line is wrong. Objects (`o`) are the file's solids; groups, materials,
//! normals and texture coordinates say nothing about them and are skipped, as are points and lines.

use glam::DVec3;

use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;

/// Reads all objects of an OBJ file; polygons are cut into triangles.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut soup = Soup::default();
    let mut polygon = Vec::new();
    for (number, text) in logical_lines(bytes) {
        let place = || format!("line {number}");
        let text = String::from_utf8_lossy(&text);
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => soup.vertices.push(position(file, place, words)?),
            Some("f") => {
                polygon.clear();
                for word in words {
                    polygon.push(corner(file, place, word, soup.vertices.len())?);
                }
                soup.push_polygon(file, place, &polygon)?;
            }
            Some("o") => soup.begin_solid(text.trim_start()[1..].trim()),
            _ => {}
        }
    }
    Ok(soup)
}

/// Lines with their number from 1; one that ends in a backslash goes on in the next. Comments are
/// left out.
fn logical_lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Vec<u8>)> + '_ {
    let mut lines = bytes.split(|&b| b == b'\n').enumerate();
    std::iter::from_fn(move || {
        let (index, first) = lines.next()?;
        let mut text = first.trim_ascii_end().to_vec();
        while text.last() == Some(&b'\\') {
            text.pop();
            let Some((_, more)) = lines.next() else { break };
            text.push(b' ');
            text.extend_from_slice(more.trim_ascii_end());
        }
        if let Some(comment) = text.iter().position(|&b| b == b'#') {
            text.truncate(comment);
        }
        Some((index + 1, text))
    })
}

/// `x y z`, then nothing, a weight to divide by, or a colour.
fn position<'a>(
    file: &str,
    place: impl Fn() -> String,
    words: impl Iterator<Item = &'a str>,
) -> Result<DVec3, MeshError> {
    let mut numbers = [0.0; 7];
    let mut count = 0;
    for word in words {
        let number = word
            .parse::<f64>()
            .map_err(|_| syntax(file, place(), "a number", format!("{word:?}")))?;
        if let Some(slot) = numbers.get_mut(count) {
            *slot = number;
        }
        count += 1;
    }
    let [x, y, z, w, ..] = numbers;
    match count {
        3 | 6 | 7 => Ok(DVec3::new(x, y, z)),
        4 if w != 0.0 => Ok(DVec3::new(x, y, z) / w),
        4 => Err(syntax(file, place(), "a weight other than 0", "0")),
        _ => Err(syntax(
            file,
            place(),
            "3 coordinates, or 4 with a weight, or 6 or 7 with a colour",
            format!("{count} numbers"),
        )),
    }
}

/// The vertex of `v`, `v/vt`, `v/vt/vn` or `v//vn`: from 1 for the first in the file, from -1 for
/// the last so far.
fn corner(
    file: &str,
    place: impl Fn() -> String,
    word: &str,
    vertices: usize,
) -> Result<u32, MeshError> {
    let index = word.split('/').next().unwrap_or_default();
    let wrong = || {
        let expected = format!("a vertex index 1 .. {vertices} or -{vertices} .. -1");
        syntax(file, place(), expected, format!("{word:?}"))
    };
    let index: i64 = index.parse().map_err(|_| wrong())?;
    let vertex = match index {
        1.. => index - 1,
        0 => return Err(wrong()),
        _ => vertices as i64 + index,
    };
    // A face may come before its vertices, so only the end of the file says which exist; hygiene
    // checks that.
    u32::try_from(vertex).map_err(|_| wrong())
}
