//! PLY, ASCII and binary of both byte orders.

use std::borrow::Cow;

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
    PropertyType, ScalarType,
};

use super::parts;
use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;
use crate::text::quoted;

/// Names of the list of a face's corners.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads the elements `vertex` (x, y, z) and `face` (`vertex_indices` or `vertex_index`) of a PLY
/// file and lists others; polygons are cut into triangles. Each closed body is a solid.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let bytes = with_line_feeds(bytes);
    let mut reader = Reader::new(&*bytes);
    let wrong = |place: &str, error: &dyn std::fmt::Display| {
        syntax(file, place, "a PLY file", error.to_string())
    };
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut reader)
        .map_err(|e| wrong("header", &e))?;
    check_header(file, &header)?;
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    for (name, element) in &header.elements {
        check_count(file, element, &header, reader.get_ref().len())?;
        let fail =
            |e: ply_rs_bw::parser::ParseError| wrong(&format!("element {}", quoted(name)), &e);
        match name.as_str() {
            "vertex" => {
                vertices = Parser::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(fail)?;
            }
            "face" => {
                faces = Parser::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(fail)?;
            }
            _ => {
                Parser::<SkippedElement>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(fail)?;
            }
        }
    }
    let mut soup = assemble(file, &vertices, &faces)?;
    list(&mut soup, &header);
    let rest = reader.get_ref().trim_ascii();
    if !rest.is_empty() {
        let found = format!("{} bytes", rest.len());
        let reason = "they come after the elements that the header counts";
        soup.record_loss(None, "end of file", &found, reason);
    }
    parts::divide_bodies(&mut soup);
    Ok(soup)
}

/// The file with line feeds at the ends of lines, where an old Macintosh put carriage returns.
fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    let end = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
    let old = end.is_some_and(|end| bytes[end] == b'\r' && bytes.get(end + 1) != Some(&b'\n'));
    if !old {
        return Cow::Borrowed(bytes);
    }
    let mark: &[u8] = b"\rend_header\r";
    let header = bytes.windows(mark.len()).position(|w| w == mark);
    let header = header.map_or(bytes.len(), |at| at + mark.len());
    let ascii = bytes[..header].windows(12).any(|w| w == b"format ascii");
    let text = if ascii { bytes.len() } else { header };
    let mut kept = bytes.to_vec();
    for byte in &mut kept[..text] {
        if *byte == b'\r' {
            *byte = b'\n';
        }
    }
    Cow::Owned(kept)
}

/// `elements "vertex", "face"`.
fn all_of<'a>(what: &str, names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<String> = names.map(|name| quoted(name)).collect();
    format!("{what} {}", names.join(", "))
}

/// Refuses a file without positions or faces.
fn check_header(file: &str, header: &Header) -> Result<(), MeshError> {
    let refuse = |expected: String, found: String| Err(syntax(file, "header", expected, found));
    for name in ["vertex", "face"] {
        let Some(element) = header.elements.get(name) else {
            return refuse(
                format!("element {}", quoted(name)),
                all_of("elements", header.elements.iter().map(|e| e.0)),
            );
        };
        let found: Vec<&String> = element.properties.iter().map(|(name, _)| name).collect();
        let has = |wanted: &str| found.iter().any(|name| *name == wanted);
        let complete = match name {
            "vertex" => ["x", "y", "z"].into_iter().all(has),
            _ => CORNERS.into_iter().any(has),
        };
        if !complete {
            let expected = match name {
                "vertex" => "x, y and z of each vertex".to_owned(),
                _ => format!("a list {} of each face", quoted(CORNERS[0])),
            };
            return refuse(expected, all_of("properties", found.into_iter()));
        }
    }
    Ok(())
}

/// Says what was read and what was not.
fn list(soup: &mut Soup, header: &Header) {
    for (name, element) in &header.elements {
        let read: &[&str] = match name.as_str() {
            "vertex" => &["x", "y", "z"],
            "face" => &CORNERS,
            "tristrips" if element.count > 0 => {
                soup.record_loss(None, "element \"tristrips\"", name, "strips of triangles");
                continue;
            }
            _ => {
                let item = format!("element {}", quoted(name));
                soup.ignore(&item, "it is no part of a surface", element.count);
                continue;
            }
        };
        soup.read(name, element.count);
        for (property, _) in &element.properties {
            if !read.contains(&property.as_str()) {
                let item = format!("property {} of {name}", quoted(property));
                let reason = "it does not say where the surface is";
                soup.ignore(&item, reason, element.count);
            }
        }
    }
}

/// Refuses a count that the rest of the file is too short for.
fn check_count(
    file: &str,
    element: &ElementDef,
    header: &Header,
    left: usize,
) -> Result<(), MeshError> {
    let size = |scalar: &ScalarType| match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    let smallest: usize = element
        .properties
        .iter()
        .map(
            |(_, property)| match (&property.data_type, header.encoding) {
                // At least a digit and a separator, but the last may end the file.
                (_, Encoding::Ascii) => 1,
                (PropertyType::Scalar(scalar) | PropertyType::List(scalar, _), _) => size(scalar),
            },
        )
        .sum();
    // An element without properties takes no bytes in a binary file, so that any count would fit.
    let limit = left / smallest.max(1);
    if element.count <= limit {
        return Ok(());
    }
    let place = format!("element {}", quoted(&element.name));
    let expected = format!("at most {limit} in the {left} bytes left");
    Err(syntax(file, place, expected, format!("{}", element.count)))
}

fn assemble(file: &str, vertices: &[Vertex], faces: &[Face]) -> Result<Soup, MeshError> {
    let mut soup = Soup {
        vertices: vertices.iter().map(|v| DVec3::from_array(v.0)).collect(),
        triangles: Vec::with_capacity(faces.len()),
        ..Soup::default()
    };
    let mut corners = Vec::new();
    for (number, Face(indices)) in faces.iter().enumerate() {
        let place = || format!("face {number}");
        corners.clear();
        for &index in indices {
            let vertex = u32::try_from(index).ok();
            let vertex = vertex.filter(|&v| (v as usize) < vertices.len());
            corners.push(vertex.ok_or_else(|| {
                let expected = format!("vertex indices 0 .. {}", vertices.len());
                syntax(file, place(), expected, index.to_string())
            })?);
        }
        soup.push_polygon(file, place, &corners)?;
    }
    Ok(soup)
}

/// A position; a coordinate that the file does not give stays NaN, which repair refuses.
struct Vertex([f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = match property {
            Property::Float(x) => f64::from(x),
            Property::Double(x) => x,
            Property::Char(x) => f64::from(x),
            Property::UChar(x) => f64::from(x),
            Property::Short(x) => f64::from(x),
            Property::UShort(x) => f64::from(x),
            Property::Int(x) => f64::from(x),
            Property::UInt(x) => f64::from(x),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Vertex indices around a face.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        fn wide<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
            list.into_iter().map(Into::into).collect()
        }
        self.0 = match property {
            Property::ListChar(list) => wide(list),
            Property::ListUChar(list) => wide(list),
            Property::ListShort(list) => wide(list),
            Property::ListUShort(list) => wide(list),
            Property::ListInt(list) => wide(list),
            Property::ListUInt(list) => wide(list),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element that says nothing about the solid.
struct SkippedElement;

impl PropertyAccess for SkippedElement {
    fn new() -> Self {
        Self
    }
}
