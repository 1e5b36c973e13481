//! Elements of an XML file, with what they hold.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use sdf_grid::text::quoted;

use crate::solids::error::ImportError;

/// Elements within elements beyond which a file is refused: walks down the tree are recursive.
const DEEPEST: usize = 256;

/// An element, its attributes and the elements in it; text is left out.
#[derive(Debug, Default)]
pub(crate) struct Element {
    /// With its prefix, if it has one.
    pub(crate) name: String,
    attributes: Vec<(String, String)>,
    pub(crate) children: Vec<Element>,
}

impl Element {
    /// The root of a file.
    pub(crate) fn read(path: &Path) -> Result<Self, ImportError> {
        let text = std::fs::read_to_string(path).map_err(|source| ImportError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &text)
    }

    /// The root of a file's text.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<Self, ImportError> {
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
            let key = attribute.key.as_ref().to_owned();
            attributes.push((key, value.into_owned()));
        }
        Ok(Self {
            name: start.name().as_ref().to_owned(),
            attributes,
            children: Vec::new(),
        })
    }

    /// An attribute's text.
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    /// Names and texts of its attributes.
    pub(crate) fn attributes(&self) -> impl Iterator<Item = (&str, &str)> {
        self.attributes
            .iter()
            .map(|(k, v)| (k.as_str(), v.as_str()))
    }

    /// The elements in it of that name.
    pub(crate) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |c| c.name == name)
    }

    /// The first of them.
    pub(crate) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|c| c.name == name)
    }

    /// What is wrong with it.
    pub(crate) fn wrong(
        &self,
        path: &Path,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> ImportError {
        let name = self.attribute("name").map(|n| format!(" {}", quoted(n)));
        ImportError::Description {
            path: path.to_owned(),
            place: format!("<{}>{}", self.name, name.unwrap_or_default()),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Finite numbers of an attribute, `N` of them; none if it is not there.
    pub(crate) fn numbers<const N: usize>(
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
                format!("{N} numbers as {}", quoted(name)),
                quoted(text),
            )),
        }
    }

    /// An attribute that must be there.
    pub(crate) fn required(&self, path: &Path, name: &str) -> Result<&str, ImportError> {
        (self.attribute(name))
            .ok_or_else(|| self.wrong(path, format!("an attribute {}", quoted(name)), "none"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = "<?xml version=\"1.0\"?><!-- a robot --><robot name=\"a &amp; b\">\
                         <link name=\"base\"><visual/></link><link name=\"tool\">text</link></robot>";

    #[test]
    fn elements_are_in_elements() {
        let robot = Element::parse(Path::new("a.urdf"), ROBOT).unwrap();
        assert_eq!(
            (robot.name.as_str(), robot.attribute("name")),
            ("robot", Some("a & b"))
        );
        let names: Vec<_> = robot
            .all("link")
            .map(|link| link.attribute("name"))
            .collect();
        assert_eq!(names, [Some("base"), Some("tool")]);
        assert!(robot.child("link").unwrap().child("visual").is_some());
    }

    /// Every beginning of a file, and every file with a byte of it changed, is read or refused.
    #[test]
    fn damaged_text_is_refused() {
        let path = Path::new("a.urdf");
        for end in 0..ROBOT.len() {
            assert!(Element::parse(path, &ROBOT[..end]).is_err(), "{end}");
        }
        for at in 0..ROBOT.len() {
            for byte in [b'<', b'>', b'"', b'/', b'&', b' '] {
                let mut bytes = ROBOT.as_bytes().to_vec();
                bytes[at] = byte;
                let _ = Element::parse(path, &String::from_utf8(bytes).unwrap());
            }
        }
        let deep = "<a>".repeat(100_000);
        let said = Element::parse(path, &deep).unwrap_err().to_string();
        assert!(said.contains("at most 256"), "{said}");
        assert!(Element::parse(path, "<a/><b/></a>").is_err());
        let entity = "<!DOCTYPE a [<!ENTITY x \"y\">]><a b=\"&x;\"/>";
        assert!(Element::parse(path, entity).is_err());
    }

    #[test]
    fn numbers_are_finite_and_as_many_as_asked_for() {
        let path = Path::new("a.urdf");
        let text = "<a good=\"1 -2e-3 3\" few=\"1 2\" odd=\"1 nan 2\" word=\"1 2 x\"/>";
        let element = Element::parse(path, text).unwrap();
        assert_eq!(
            element.numbers(path, "good").unwrap(),
            Some([1.0, -2e-3, 3.0])
        );
        assert_eq!(element.numbers::<3>(path, "none").unwrap(), None);
        for name in ["few", "odd", "word"] {
            assert!(element.numbers::<3>(path, name).is_err(), "{name}");
        }
    }
}
