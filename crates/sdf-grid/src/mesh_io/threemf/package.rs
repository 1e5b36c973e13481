//! The archive around the models.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Cursor, Read};

use quick_xml::events::Event;
use zip::ZipArchive;

use super::model::attribute;
use crate::mesh::error::MeshError;
use crate::mesh_io::content;
use crate::mesh_io::soup::syntax;

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
