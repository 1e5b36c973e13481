//! Settings of slicers for the parts of an object, in separate files beside the models.
//!
//! PrusaSlicer and its kin list runs of triangles (`volume`) in `Metadata/Slic3r_PE_model.config`,
//! Bambu Studio and OrcaSlicer list components (`part`) in `Metadata/model_settings.config`.

use std::collections::HashMap;
use std::io::BufRead;

use quick_xml::events::{BytesStart, Event};

use super::package::{Package, attribute};
use crate::mesh::error::MeshError;
use crate::mesh_io::soup::syntax;
use crate::text::quoted;

/// The purpose of a part of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Purpose {
    /// Material.
    #[default]
    Material,
    /// It is cut out of the material.
    Negative,
    /// Print settings hold, or supports stand or do not, where it is.
    Setting,
    /// A word that is not known here.
    Unknown,
}

impl Purpose {
    /// By the words of PrusaSlicer, Bambu Studio and OrcaSlicer.
    fn named(word: &str) -> Self {
        match word {
            "ModelPart" | "normal_part" => Self::Material,
            "NegativeVolume" | "negative_part" => Self::Negative,
            "ParameterModifier" | "SupportBlocker" | "SupportEnforcer" | "modifier_part"
            | "support_blocker" | "support_enforcer" => Self::Setting,
            _ => Self::Unknown,
        }
    }
}

/// A part of an object.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    pub(super) purpose: Purpose,
    /// The slicer's word for it.
    pub(super) word: String,
    pub(super) name: String,
}

/// The slicer's settings for one object of the root model.
#[derive(Debug, Default)]
pub(super) struct Object {
    /// Its components, by the id of the object that each is.
    pub(super) components: HashMap<u32, Part>,
    /// First and last triangle of each run.
    pub(super) runs: Vec<(usize, usize, Part)>,
}

/// The slicers' settings for the objects of the root model, by their ids.
pub(super) type Objects = HashMap<u32, Object>;

/// Reads all that slicers say.
pub(super) fn read(file: &str, package: &mut Package<'_>) -> Result<Objects, MeshError> {
    let mut objects = Objects::new();
    for path in package.settings() {
        let mut input = package.read(&path)?;
        let start = input.fill_buf().unwrap_or_default().trim_ascii_start();
        // Others hold lists of keys or JSON.
        if start.starts_with(b"<") || start.starts_with(b"\xEF\xBB\xBF<") {
            parse(file, &path, input, &mut objects)?;
        }
    }
    Ok(objects)
}

/// A part being read, and where it goes.
enum OpenElement {
    Component(u32),
    Run(usize, usize),
}

fn parse(
    file: &str,
    path: &str,
    input: impl BufRead,
    objects: &mut Objects,
) -> Result<(), MeshError> {
    let mut reader = quick_xml::Reader::from_reader(input);
    let mut buffer = Vec::new();
    let mut object = None;
    let mut open: Option<(OpenElement, Part)> = None;
    loop {
        let event = reader.read_event_into(&mut buffer).map_err(|e| {
            let place = format!("{path}, byte {}", reader.error_position());
            syntax(file, place, "XML", e.to_string())
        })?;
        match event {
            Event::Start(e) | Event::Empty(e) => {
                let get = |name: &str| attribute(file, path, &e, name);
                match e.local_name().as_ref() {
                    "object" => object = number(&e, get("id")?, file, path)?,
                    "part" | "volume" => {
                        close(objects, object, open.take());
                        open = begin(file, path, &e)?;
                    }
                    "metadata" => {
                        let (key, value) = (get("key")?, get("value")?.unwrap_or_default());
                        if let Some((_, part)) = &mut open {
                            describe(part, key.as_deref(), value);
                        }
                    }
                    _ => {}
                }
            }
            Event::End(e) if matches!(e.local_name().as_ref(), "part" | "volume" | "object") => {
                close(objects, object, open.take());
            }
            Event::Eof => {
                close(objects, object, open.take());
                return Ok(());
            }
            _ => {}
        }
        buffer.clear();
    }
}

/// A `part` or `volume` element.
fn begin(
    file: &str,
    path: &str,
    e: &BytesStart<'_>,
) -> Result<Option<(OpenElement, Part)>, MeshError> {
    let get = |name: &str| attribute(file, path, e, name);
    let mut part = Part::default();
    if let Some(word) = get("subtype")? {
        part.purpose = Purpose::named(&word);
        part.word = word;
    }
    let first = number(e, get("firstid")?, file, path)?;
    let last = number(e, get("lastid")?, file, path)?;
    let id = number(e, get("id")?, file, path)?;
    let place = match (first, last, id) {
        (Some(first), Some(last), _) => OpenElement::Run(first as usize, last as usize),
        (_, _, Some(id)) => OpenElement::Component(id),
        _ => return Ok(None),
    };
    Ok(Some((place, part)))
}

/// Takes a key of a part that says what it is.
fn describe(part: &mut Part, key: Option<&str>, value: String) {
    match key {
        Some("name") => part.name = value,
        Some("volume_type") => {
            part.purpose = Purpose::named(&value);
            part.word = value;
        }
        // As Slic3r said it first.
        Some("modifier") if value == "1" && part.word.is_empty() => {
            part.purpose = Purpose::Setting;
            part.word = "modifier".to_owned();
        }
        _ => {}
    }
}

fn close(objects: &mut Objects, object: Option<u32>, open: Option<(OpenElement, Part)>) {
    let (Some(object), Some((place, part))) = (object, open) else {
        return;
    };
    let object = objects.entry(object).or_default();
    match place {
        OpenElement::Component(id) => {
            object.components.insert(id, part);
        }
        OpenElement::Run(first, last) => object.runs.push((first, last, part)),
    }
}

fn number(
    e: &BytesStart<'_>,
    text: Option<String>,
    file: &str,
    path: &str,
) -> Result<Option<u32>, MeshError> {
    let Some(text) = text else { return Ok(None) };
    let place = format!("{path}, element {}", quoted(e.local_name().as_ref()));
    let wrong = |_| syntax(file, place, "a whole number", quoted(&text));
    text.trim().parse().map(Some).map_err(wrong)
}
