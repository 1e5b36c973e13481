//! The archive and the models in it.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Cursor, Read};

use glam::{DMat4, DVec3};
use quick_xml::events::{BytesStart, Event};
use zip::ZipArchive;

use crate::mesh::error::MeshError;
use crate::mesh_io::content;
use crate::mesh_io::soup::syntax;
use crate::mesh_io::unit::LengthUnit;
use crate::text::quoted;

/// Most bytes that a file in the archive may unpack to, per byte of the archive; deflated models
/// take 5 to 30.
const MOST_UNPACKED: u64 = 200;

/// The relationship that names the model to start with.
const START: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

/// An open archive.
pub(super) struct Package<'a> {
    file: &'a str,
    archive: ZipArchive<Cursor<&'a [u8]>>,
    limit: u64,
}

impl<'a> Package<'a> {
    pub(super) fn open(file: &'a str, bytes: &'a [u8]) -> Result<Self, MeshError> {
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|e| syntax(file, "archive", "a zip archive", e.to_string()))?;
        Ok(Self {
            file,
            archive,
            limit: MOST_UNPACKED * bytes.len() as u64,
        })
    }

    /// The path of the model that the archive starts with.
    pub(super) fn root(&mut self) -> Result<String, MeshError> {
        let file = self.file;
        let place = "_rels/.rels";
        let mut reader = quick_xml::Reader::from_reader(self.read(place)?);
        let mut buffer = Vec::new();
        loop {
            let event = reader
                .read_event_into(&mut buffer)
                .map_err(|e| syntax(file, place, "XML", e.to_string()))?;
            match event {
                Event::Start(e) | Event::Empty(e) => {
                    let get = |name| attribute(file, place, &e, name);
                    if get("Type")?.as_deref() == Some(START)
                        && let Some(target) = get("Target")?
                    {
                        return Ok(target);
                    }
                }
                Event::Eof => return Err(syntax(file, place, "a 3D model", "none")),
                _ => {}
            }
            buffer.clear();
        }
    }

    /// Paths of the files in which slicers keep settings.
    pub(super) fn settings(&self) -> Vec<String> {
        let named = |name: &String| {
            let name = name.to_ascii_lowercase();
            name.starts_with("metadata/") && name.ends_with(".config")
        };
        // A name that is no text is none of these.
        let names = self.archive.file_names().filter_map(Result::ok);
        names.map(Cow::into_owned).filter(named).collect()
    }

    /// A file in the archive as UTF-8, unpacked as it is read and cut off at the limit.
    pub(super) fn read(&mut self, path: &str) -> Result<Box<dyn BufRead + '_>, MeshError> {
        let (file, limit) = (self.file, self.limit);
        let entry = self
            .archive
            .by_name(path.trim_start_matches('/'))
            .map_err(|e| syntax(file, path, "a file in the archive", e.to_string()))?;
        let mut entry = BufReader::new(entry.take(limit));
        let unreadable = |e: std::io::Error| syntax(file, path, "packed data", e.to_string());
        let start = entry.fill_buf().map_err(unreadable)?;
        let Some(big) = content::utf16(start) else {
            return Ok(Box::new(entry));
        };
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).map_err(unreadable)?;
        Ok(Box::new(Cursor::new(content::from_utf16(&bytes, big))))
    }
}

/// A model file's content.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) unit: LengthUnit,
    /// Whether the file states it.
    pub(super) unit_stated: bool,
    /// Extensions that it requires and that are not read, by their namespaces.
    pub(super) extensions: Vec<String>,
    /// Counts of its other elements, by name.
    pub(super) resources: Vec<String>,
    /// Objects by their id.
    pub(super) objects: HashMap<u32, Object>,
    /// The items to build.
    pub(super) items: Vec<Placement>,
}

/// A mesh or an assembly.
#[derive(Debug)]
pub(super) struct Object {
    pub(super) name: String,
    /// `model` for a solid, else `support`, `surface` and the like.
    pub(super) role: String,
    /// What Cura does with it instead of printing it.
    setting: Option<String>,
    /// Elements that make its shape another one and are not read.
    pub(super) unread: Vec<String>,
    pub(super) kind: Kind,
}

impl Object {
    /// Why it is no material of a part, if so.
    pub(super) fn left_out(&self) -> Option<String> {
        match (&self.setting, self.role.as_str()) {
            (Some(setting), _) => Some(format!("{setting}: it is a setting for printing")),
            (None, "model") => None,
            (None, role) => Some(format!("of type {role}: it is no material of a part")),
        }
    }
}

/// The content of an object.
#[derive(Debug)]
pub(super) enum Kind {
    Mesh {
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
    },
    Components(Vec<Placement>),
}

/// An object and where it is put.
#[derive(Debug)]
pub(super) struct Placement {
    pub(super) object: u32,
    /// From the object's frame to that of what holds it.
    pub(super) transform: DMat4,
    /// The model that holds the object, if it is another one.
    pub(super) path: Option<String>,
}

/// Namespaces of extensions that may be required: what they add is read, or no boundary.
const EXTENSIONS: [&str; 4] = [
    "http://schemas.microsoft.com/3dmanufacturing/production/",
    "http://schemas.microsoft.com/3dmanufacturing/material/",
    "http://schemas.microsoft.com/3dmanufacturing/slice/",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/",
];

/// Elements within objects and meshes that are read or change no shape.
const WITHIN: [&str; 6] = [
    "mesh",
    "components",
    "metadatagroup",
    "vertices",
    "triangles",
    "trianglesets",
];

/// Metadata with which Cura says that a mesh is none to print.
const CURA: [&str; 4] = [
    "support_mesh",
    "anti_overhang_mesh",
    "infill_mesh",
    "cutting_mesh",
];

/// Reads a model in one pass.
pub(super) fn parse_model(file: &str, path: &str, input: impl BufRead) -> Result<Model, MeshError> {
    let mut parser = Parser {
        file,
        path,
        model: Model::default(),
        open: None,
        within: Vec::new(),
        metadata: None,
    };
    let mut reader = quick_xml::Reader::from_reader(input);
    let mut buffer = Vec::new();
    loop {
        let event = reader.read_event_into(&mut buffer).map_err(|e| {
            let place = format!("{path}, byte {}", reader.error_position());
            syntax(file, place, "XML", e.to_string())
        })?;
        match event {
            Event::Empty(e) => parser.element(&e)?,
            Event::Start(e) => {
                parser.element(&e)?;
                parser.within.push(e.local_name().as_ref().into());
            }
            Event::Text(text) => parser.text(&text),
            Event::Eof if parser.open.is_some() => {
                return Err(syntax(
                    file,
                    path,
                    "the end of an object",
                    "the end of the file",
                ));
            }
            Event::Eof => return Ok(parser.model),
            Event::End(e) => {
                parser.within.pop();
                if e.local_name().as_ref() == "object" {
                    parser.close();
                }
            }
            _ => {}
        }
        buffer.clear();
    }
}

struct Parser<'a> {
    file: &'a str,
    path: &'a str,
    model: Model,
    /// The object being read.
    open: Option<(u32, Object)>,
    /// The elements around what is read next.
    within: Vec<Box<str>>,
    /// Name of the metadata whose text is read next.
    metadata: Option<String>,
}

impl Parser<'_> {
    fn element(&mut self, e: &BytesStart<'_>) -> Result<(), MeshError> {
        match e.local_name().as_ref() {
            "model" => {
                self.model.unit_stated = self.attribute(e, "unit")?.is_some();
                self.model.unit = self.unit(e)?;
                self.model.extensions = self.unread_extensions(e)?;
            }
            "object" => self.object(e)?,
            "vertex" => {
                let position = DVec3::new(
                    self.number(e, "x")?,
                    self.number(e, "y")?,
                    self.number(e, "z")?,
                );
                if let Some((Kind::Mesh { vertices, .. }, _)) = self.kind() {
                    vertices.push(position);
                }
            }
            "triangle" => {
                let corners = [
                    self.number(e, "v1")?,
                    self.number(e, "v2")?,
                    self.number(e, "v3")?,
                ];
                self.triangle(corners)?;
            }
            "component" => {
                let placed = self.placed(e)?;
                if let Some((Kind::Components(list), _)) = self.kind() {
                    list.push(placed);
                }
            }
            "components" => {
                if let Some((kind, _)) = self.kind() {
                    *kind = Kind::Components(Vec::new());
                }
            }
            "item" => {
                let placed = self.placed(e)?;
                self.model.items.push(placed);
            }
            "metadata" => self.metadata = self.attribute(e, "name")?,
            other => self.other(other),
        }
        Ok(())
    }

    /// An element that is not read, by where it is.
    fn other(&mut self, name: &str) {
        match self.within.last().map(|parent| &**parent) {
            Some("resources") => self.model.resources.push(name.to_owned()),
            Some("object" | "mesh") if !WITHIN.contains(&name) => {
                if let Some((_, object)) = &mut self.open {
                    object.unread.push(name.to_owned());
                }
            }
            _ => {}
        }
    }

    fn text(&mut self, text: &str) {
        let Some(name) = self.metadata.take() else {
            return;
        };
        let setting = name.rsplit(':').next().unwrap_or_default();
        let on = text.trim().eq_ignore_ascii_case("true") || text.trim() == "1";
        if let Some((_, object)) = &mut self.open
            && on
            && CURA.contains(&setting)
        {
            object.setting = Some(name);
        }
    }

    /// Namespaces of the extensions that a model requires and that are not known here.
    fn unread_extensions(&self, e: &BytesStart<'_>) -> Result<Vec<String>, MeshError> {
        let required = self.attribute(e, "requiredextensions")?.unwrap_or_default();
        let mut unread = Vec::new();
        for prefix in required.split_whitespace() {
            let space = self.attribute(e, prefix)?.unwrap_or(prefix.to_owned());
            if !EXTENSIONS.iter().any(|known| space.starts_with(known)) {
                unread.push(space);
            }
        }
        Ok(unread)
    }

    /// What the open object is made of so far, and its id.
    fn kind(&mut self) -> Option<(&mut Kind, u32)> {
        self.open
            .as_mut()
            .map(|(id, object)| (&mut object.kind, *id))
    }

    fn object(&mut self, e: &BytesStart<'_>) -> Result<(), MeshError> {
        let id = self.number(e, "id")?;
        let kind = self.attribute(e, "type")?;
        self.close();
        let resolution = self.attribute(e, "meshresolution")?;
        let object = Object {
            name: self.attribute(e, "name")?.unwrap_or_default(),
            role: kind.unwrap_or_else(|| "model".to_owned()),
            setting: None,
            unread: Vec::new(),
            kind: Kind::Mesh {
                vertices: Vec::new(),
                triangles: Vec::new(),
            },
        };
        self.open = Some((id, object));
        if resolution.as_deref() == Some("lowres")
            && let Some((_, object)) = &mut self.open
        {
            object.unread.push("meshresolution=\"lowres\"".to_owned());
        }
        Ok(())
    }

    fn close(&mut self) {
        if let Some((id, object)) = self.open.take() {
            self.model.objects.insert(id, object);
        }
    }

    /// Vertices come before the triangles on them.
    fn triangle(&mut self, corners: [u32; 3]) -> Result<(), MeshError> {
        let (file, path) = (self.file, self.path);
        let Some((
            Kind::Mesh {
                vertices,
                triangles,
            },
            id,
        )) = self.kind()
        else {
            return Ok(());
        };
        if let Some(beyond) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
            let place = format!("{path}, object {id}, triangle {}", triangles.len());
            let expected = format!("vertex indices below {}", vertices.len());
            return Err(syntax(file, place, expected, beyond.to_string()));
        }
        triangles.push(corners);
        Ok(())
    }

    fn placed(&self, e: &BytesStart<'_>) -> Result<Placement, MeshError> {
        Ok(Placement {
            object: self.number(e, "objectid")?,
            transform: self.transform(e)?,
            path: self.attribute(e, "path")?,
        })
    }

    /// Twelve numbers: three rows that a row vector's coordinates multiply, then the translation.
    fn transform(&self, e: &BytesStart<'_>) -> Result<DMat4, MeshError> {
        let Some(text) = self.attribute(e, "transform")? else {
            return Ok(DMat4::IDENTITY);
        };
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let numbers = numbers.and_then(|n| <[f64; 12]>::try_from(n).ok());
        let Some(m) = numbers else {
            return Err(self.wrong(e, "a transform of 12 numbers", quoted(&text)));
        };
        let [x, y, z, t] = [0, 3, 6, 9].map(|i| DVec3::new(m[i], m[i + 1], m[i + 2]));
        Ok(DMat4::from_cols(
            x.extend(0.0),
            y.extend(0.0),
            z.extend(0.0),
            t.extend(1.0),
        ))
    }

    fn unit(&self, e: &BytesStart<'_>) -> Result<LengthUnit, MeshError> {
        let name = self.attribute(e, "unit")?;
        match name.as_deref() {
            Some("micron") => Ok(LengthUnit::Um),
            None | Some("millimeter") => Ok(LengthUnit::Mm),
            Some("centimeter") => Ok(LengthUnit::Cm),
            Some("inch") => Ok(LengthUnit::Inch),
            Some("foot") => Ok(LengthUnit::Foot),
            Some("meter") => Ok(LengthUnit::M),
            Some(other) => {
                let expected = "micron, millimeter, centimeter, inch, foot or meter";
                Err(self.wrong(e, expected, quoted(other)))
            }
        }
    }

    fn number<T: std::str::FromStr>(&self, e: &BytesStart<'_>, name: &str) -> Result<T, MeshError> {
        let text = self.attribute(e, name)?.unwrap_or_default();
        text.trim()
            .parse()
            .map_err(|_| self.wrong(e, &format!("a number as {}", quoted(name)), quoted(&text)))
    }

    fn attribute(&self, e: &BytesStart<'_>, name: &str) -> Result<Option<String>, MeshError> {
        attribute(self.file, self.path, e, name)
    }

    fn wrong(&self, e: &BytesStart<'_>, expected: &str, found: String) -> MeshError {
        let object = match &self.open {
            Some((id, _)) => format!(", object {id}"),
            None => String::new(),
        };
        let place = format!(
            "{}{object}, element {}",
            self.path,
            quoted(e.local_name().as_ref())
        );
        syntax(self.file, place, expected, found)
    }
}

/// The value of an attribute, whatever its namespace.
pub(super) fn attribute(
    file: &str,
    place: &str,
    e: &BytesStart<'_>,
    name: &str,
) -> Result<Option<String>, MeshError> {
    for attribute in e.attributes() {
        let attribute = attribute.map_err(|e| syntax(file, place, "attributes", e.to_string()))?;
        if attribute.key.local_name().as_ref() == name {
            let value = attribute
                .normalized_value(quick_xml::XmlVersion::default())
                .map_err(|e| syntax(file, place, "an attribute's text", e.to_string()))?;
            return Ok(Some(value.into_owned()));
        }
    }
    Ok(None)
}
