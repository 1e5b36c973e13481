//! The archive around the models.

use std::io::{BufRead, BufReader, Cursor, Read};

use quick_xml::events::Event;
use zip::ZipArchive;

use super::model::attribute;
use crate::mesh::error::MeshError;
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

    /// A file in the archive, unpacked as it is read and cut off at the limit.
    pub(super) fn read(&mut self, path: &str) -> Result<impl BufRead + use<'_, 'a>, MeshError> {
        let limit = self.limit;
        let entry = self
            .archive
            .by_name(path.trim_start_matches('/'))
            .map_err(|e| syntax(self.file, path, "a file in the archive", e.to_string()))?;
        Ok(BufReader::new(entry.take(limit)))
    }
}
