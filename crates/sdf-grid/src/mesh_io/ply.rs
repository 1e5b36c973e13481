//! PLY, ASCII and binary of both byte orders.

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
    PropertyType, ScalarType,
};

use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;

/// Reads the elements `vertex` (x, y, z) and `face` (`vertex_indices` or `vertex_index`) of a PLY
/// file and skips others; polygons are cut into triangles.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut reader = Reader::new(bytes);
    let wrong = |place: &str, error: &dyn std::fmt::Display| {
        syntax(file, place, "a PLY file", error.to_string())
    };
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut reader)
        .map_err(|e| wrong("header", &e))?;
    let names: Vec<&str> = header
        .elements
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    for name in ["vertex", "face"] {
        if !names.contains(&name) {
            let found = format!("elements {names:?}");
            return Err(syntax(file, "header", format!("element {name:?}"), found));
        }
    }
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    for (name, element) in &header.elements {
        check_count(file, element, &header, reader.get_ref().len())?;
        let fail = |e: ply_rs_bw::parser::ParseError| wrong(&format!("element {name:?}"), &e);
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
                Parser::<Skipped>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(fail)?;
            }
        }
    }
    assemble(file, &vertices, &faces)
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
    let place = format!("element {:?}", element.name);
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

/// A position; a coordinate that the file does not give stays NaN, which hygiene refuses.
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
        if !matches!(name, "vertex_indices" | "vertex_index") {
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
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
