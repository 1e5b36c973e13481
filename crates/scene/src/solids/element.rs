//! Elements of an XML file, with what they hold.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::solids::error::ImportError;

/// Elements within elements beyond which a file is refused: walks down the tree are recursive.
const DEEPEST: usize = 256;

/// An element, its attributes and the elements in it; text is left out.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) name: String,
    attributes: Vec<(String, String)>,
    pub(super) children: Vec<Element>,
}

impl Element {
    /// The root of a file.
    pub(super) fn read(path: &Path) -> Result<Self, ImportError> {
        let text = std::fs::read_to_string(path).map_err(|source| ImportError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &text)
    }

    /// The root of a file's text.
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self, ImportError> {
        let wrong = |at: u64, expected: &str, found: String| ImportError::Description {
            path: path.to_owned(),
            place: format!("byte {at}"),
            expected: expected.to_owned(),
            found,
        };
        let mut reader = Reader::from_str(text);
        // Elements that are open; the first holds the root.
        let mut open = vec![Self::default()];
        loop {
            let event = reader.read_event();
            let at = reader.buffer_position();
            match event.map_err(|e| wrong(at, "XML", e.to_string()))? {
                Event::Start(e) => {
                    if open.len() > DEEPEST {
                        let expected = format!("at most {DEEPEST} elements within each other");
                        return Err(wrong(at, &expected, "more".to_owned()));
                    }
                    open.push(Self::begin(&e).map_err(|found| wrong(at, "attributes", found))?);
                }
                Event::Empty(e) => {
                    let element = Self::begin(&e).map_err(|f| wrong(at, "attributes", f))?;
                    if let Some(parent) = open.last_mut() {
                        parent.children.push(element);
                    }
                }
                Event::End(_) if open.len() > 1 => {
                    let closed = open.pop().unwrap_or_default();
                    if let Some(parent) = open.last_mut() {
                        parent.children.push(closed);
                    }
                }
                Event::Eof => break,
                _ => {}
            }
        }
        match (
            open.len(),
            open.pop().and_then(|mut top| top.children.pop()),
        ) {
            (1, Some(root)) => Ok(root),
            _ => Err(wrong(
                text.len() as u64,
                "one root element that ends",
                "none".to_owned(),
            )),
        }
    }

    fn begin(start: &BytesStart<'_>) -> Result<Self, String> {
        let mut attributes = Vec::new();
        for attribute in start.attributes() {
            let attribute = attribute.map_err(|e| e.to_string())?;
            let value = (attribute.normalized_value(quick_xml::XmlVersion::default()))
                .map_err(|e| e.to_string())?;
            let key = attribute.key.local_name().as_ref().to_owned();
            attributes.push((key, value.into_owned()));
        }
        Ok(Self {
            name: start.local_name().as_ref().to_owned(),
            attributes,
            children: Vec::new(),
        })
    }

    /// An attribute's text.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    /// The elements in it of that name.
    pub(super) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |c| c.name == name)
    }

    /// The first of them.
    pub(super) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|c| c.name == name)
    }

    /// What is wrong with it.
    pub(super) fn wrong(
        &self,
        path: &Path,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> ImportError {
        let name = self.attribute("name").map(|n| format!(" {n:?}"));
        ImportError::Description {
            path: path.to_owned(),
            place: format!("<{}>{}", self.name, name.unwrap_or_default()),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Finite numbers of an attribute, `N` of them; none if it is not there.
    pub(super) fn numbers<const N: usize>(
        &self,
        path: &Path,
        name: &str,
    ) -> Result<Option<[f64; N]>, ImportError> {
        let Some(text) = self.attribute(name) else {
            return Ok(None);
        };
        let parsed: Option<Vec<f64>> = (text.split_whitespace())
            .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        match parsed.and_then(|n| <[f64; N]>::try_from(n).ok()) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(self.wrong(
                path,
                format!("{N} numbers as {name:?}"),
                format!("{text:?}"),
            )),
        }
    }

    /// An attribute that must be there.
    pub(super) fn required(&self, path: &Path, name: &str) -> Result<&str, ImportError> {
        (self.attribute(name))
            .ok_or_else(|| self.wrong(path, format!("an attribute {name:?}"), "none"))
    }
}
