//! Wavefront OBJ: positions and faces, in double precision, errors with line numbers.
//!
//! Read here rather than through a library because the ones there are round to single precision
//! or cannot say which line is wrong. Objects (`o`) are the file's solids; where there is none,
//! groups (`g`) are, as far as each is closed.

use std::io;
use std::path::Path;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::soup::{Soup, syntax};
use super::{content, parts};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::mesh_io::unit::LengthUnit;
use crate::support::atomic;
use crate::text::quoted;

/// Words that begin a statement, not the rest of one: a line is not joined with one that begins so.
const WORDS: [&str; 28] = [
    "v", "vn", "vt", "vp", "f", "fo", "l", "p", "o", "g", "s", "mg", "usemtl", "mtllib", "usemap",
    "maplib", "call", "csh", "cstype", "deg", "curv", "curv2", "surf", "parm", "trim", "hole",
    "end", "lod",
];

/// Statements whose rest is a name, which may end in a backslash, as paths do.
const NAMES: [&str; 6] = ["o", "g", "usemtl", "mtllib", "usemap", "maplib"];

/// Why statements are not read that change no solid.
const APPEARANCE: &str = "it changes the look, not the solid";
const NO_VOLUME: &str = "it encloses no volume";
const CURVE: &str = "it describes curves or surfaces of free form";

/// Reads all objects of an OBJ file; polygons are cut into triangles.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut reader = ObjReader {
        file,
        soup: Soup::default(),
        polygon: Vec::new(),
        faces: 0,
        objects: Labels::default(),
        groups: Labels::default(),
    };
    for (number, text) in logical_lines(bytes) {
        let text = String::from_utf8_lossy(&text);
        let mut words = text.split_whitespace();
        if let Some(word) = words.next() {
            reader.statement(number, word, &text, words)?;
        }
    }
    Ok(reader.finish())
}

/// Names that hold from a triangle on.
#[derive(Debug, Default)]
struct Labels {
    /// Name and first triangle.
    starts: Vec<(String, usize)>,
}

struct ObjReader<'a> {
    file: &'a str,
    soup: Soup,
    /// The corners of a face.
    polygon: Vec<u32>,
    faces: usize,
    objects: Labels,
    groups: Labels,
}

impl ObjReader<'_> {
    fn statement<'a>(
        &mut self,
        number: usize,
        word: &str,
        text: &str,
        words: impl Iterator<Item = &'a str>,
    ) -> Result<(), MeshError> {
        let place = || format!("line {number}");
        let here = self.soup.triangles.len();
        match word {
            "v" => self.soup.vertices.push(position(self.file, place, words)?),
            // `fo` is how faces were written before version 3 of the format.
            "f" | "fo" => {
                self.polygon.clear();
                for word in words {
                    let vertices = self.soup.vertices.len();
                    self.polygon.push(corner(self.file, place, word, vertices)?);
                }
                self.faces += 1;
                self.soup.push_polygon(self.file, place, &self.polygon)?;
            }
            "o" => {
                let name = text.trim_start()[1..].trim().to_owned();
                self.objects.starts.push((name, here));
            }
            "g" => {
                let name = words.collect::<Vec<_>>().join(" ");
                self.groups.starts.push((name, here));
            }
            _ => self.skip(number, word),
        }
        Ok(())
    }

    /// A statement that is not read; one that would change a solid is noted as lost.
    fn skip(&mut self, number: usize, word: &str) {
        let ignored = match word {
            "vn" => "faces are oriented by their corners",
            "vt" | "usemtl" | "mtllib" | "usemap" | "maplib" | "s" | "mg" | "lod" | "bevel"
            | "c_interp" | "d_interp" | "ctech" | "stech" | "shadow_obj" | "trace_obj" => {
                APPEARANCE
            }
            "l" | "p" | "curv" | "curv2" | "cdc" => NO_VOLUME,
            "vp" | "cstype" | "deg" | "bmat" | "step" | "parm" | "trim" | "hole" | "scrv"
            | "sp" | "end" | "con" | "res" => CURVE,
            "csh" => "commands in files are not run",
            _ => {
                let (item, reason) = match word {
                    "surf" | "bsp" | "bzp" | "cdp" => (word, "a surface of free form"),
                    "call" => (word, "another file, read into this one"),
                    _ => ("unknown statement", "one that OBJ does not have"),
                };
                let place = format!("line {number}, {}", quoted(word));
                return self.soup.record_loss(None, place, item, reason);
            }
        };
        self.soup.ignore(word, ignored, 1);
    }

    fn finish(self) -> Soup {
        let mut soup = self.soup;
        soup.read("v", soup.vertices.len());
        soup.read("f", self.faces);
        let objects = self.objects.starts.len();
        soup.read("o", objects);
        let groups = self.groups.starts.len();
        if objects > 0 {
            soup.ignore("g", "the solids are its objects (o)", groups);
            self.objects.divide(&mut soup, false);
            parts::join_namesakes(&mut soup);
            return soup;
        }
        soup.read("g", groups);
        if groups > 0 {
            self.groups.divide(&mut soup, true);
            parts::join_open(&mut soup, "group");
        }
        parts::divide_bodies(&mut soup);
        soup
    }
}

impl Labels {
    /// Makes solids of names; of equal names one solid if they are `joined`. What comes before the
    /// first is a solid without a name.
    fn divide(self, soup: &mut Soup, joined: bool) {
        let count = soup.triangles.len();
        let mut of = Vec::with_capacity(count);
        let mut names: Vec<String> = Vec::new();
        let mut known = FxHashMap::default();
        let mut starts = self.starts;
        if starts.first().is_some_and(|first| first.1 > 0) {
            starts.insert(0, (String::new(), 0));
        }
        let ends: Vec<usize> = starts.iter().skip(1).map(|s| s.1).collect();
        for ((name, _), end) in starts.into_iter().zip(ends.into_iter().chain([count])) {
            let solid = match known.get(&name) {
                Some(&solid) if joined => solid,
                _ => {
                    known.insert(name.clone(), names.len());
                    names.push(name);
                    names.len() - 1
                }
            };
            of.resize(end, solid);
        }
        soup.divide(names, &of);
    }
}

/// Lines with their number from 1; one that ends in a backslash goes on in the next, unless that is
/// a statement. Comments, from a `#` on that is not within a name, are left out first: they may end
/// in a backslash.
fn logical_lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Vec<u8>)> + '_ {
    let mut lines = content::lines(bytes)
        .map(uncommented)
        .enumerate()
        .peekable();
    std::iter::from_fn(move || {
        let (index, (first, _)) = lines.peek().copied()?;
        let mut text = Vec::new();
        while let Some((_, (line, commented))) = lines.next() {
            if !text.is_empty() {
                text.push(b' ');
            }
            let joins = line.last() == Some(&b'\\') && !commented;
            let next = lines.peek().map(|next| next.1.0);
            if !joins || next.is_none_or(begins_statement) {
                // A backslash at the end of the file, or of a path, is none of a joined line.
                let name = NAMES.iter().any(|name| begins(first, name));
                text.extend(
                    line.strip_suffix(b"\\")
                        .filter(|_| joins && !name)
                        .unwrap_or(line),
                );
                break;
            }
            text.extend(&line[..line.len() - 1]);
        }
        Some((index + 1, text))
    })
}

/// A line without its comment and the space around it, and whether it had a comment.
fn uncommented(line: &[u8]) -> (&[u8], bool) {
    let named = NAMES
        .iter()
        .any(|name| begins(line.trim_ascii_start(), name));
    let starts = |i: usize| !named || i == 0 || line[i - 1].is_ascii_whitespace();
    let comment = (0..line.len()).find(|&i| line[i] == b'#' && starts(i));
    let kept = &line[..comment.unwrap_or(line.len())];
    // Some programs end files as CP/M did, or fill them up with zeros.
    let padding = |b: &u8| b.is_ascii_whitespace() || matches!(b, 0 | 0x1A);
    let end = kept.iter().rposition(|b| !padding(b)).map_or(0, |i| i + 1);
    (kept[..end].trim_ascii_start(), comment.is_some())
}

/// Whether a line is no rest of the one before.
fn begins_statement(line: &[u8]) -> bool {
    line.is_empty() || WORDS.iter().any(|word| begins(line, word))
}

/// Whether the first word of a line is this one.
fn begins(line: &[u8], word: &str) -> bool {
    let rest = line.strip_prefix(word.as_bytes());
    rest.is_some_and(|rest| rest.first().is_none_or(u8::is_ascii_whitespace))
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
            .map_err(|_| syntax(file, place(), "a number", quoted(word)))?;
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
        syntax(file, place(), expected, quoted(word))
    };
    let index: i64 = index.parse().map_err(|_| wrong())?;
    let vertex = match index {
        1.. => index - 1,
        0 => return Err(wrong()),
        _ => vertices as i64 + index,
    };
    // A face may come before its vertices, so only the end of the file says which exist; repair
    // checks that.
    u32::try_from(vertex).map_err(|_| wrong())
}

/// Writes a mesh as OBJ in metres, with enough digits to read back the same numbers. The file
/// appears whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), MeshError> {
    write_obj_in(path, mesh, LengthUnit::M)
}

/// As [`write_obj`], with coordinates in `unit`: they read back to within rounding.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj_in(
    path: impl AsRef<Path>,
    mesh: &TriangleMesh,
    unit: LengthUnit,
) -> Result<(), MeshError> {
    let path = path.as_ref();
    let comment = match unit {
        LengthUnit::M => "metres",
        other => other.name(),
    };
    atomic::write_with(path, |out| -> io::Result<()> {
        writeln!(out, "# {comment}")?;
        for v in mesh.vertices() {
            let v = *v / unit.in_metres();
            writeln!(out, "v {} {} {}", v.x, v.y, v.z)?;
        }
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|i| i + 1);
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    })
    .map_err(|source| MeshError::Write {
        path: path.to_owned(),
        source,
    })
}
