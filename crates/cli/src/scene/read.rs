//! Reading a scene file.

use std::path::Path;

use super::check;
use super::raw::RawScene;
use super::source::Source;
use super::types::Scene;
use crate::error::CommandError;

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// If the file cannot be read, is not TOML, has an unknown key, or a value is out of range;
    /// the error carries the line.
    pub fn read(path: &Path) -> Result<Self, CommandError> {
        let text = std::fs::read_to_string(path).map_err(|e| CommandError::read(path, e))?;
        Self::parse(path, &text)
    }

    /// Checks the text of a scene file; `path` is where meshes are relative to.
    ///
    /// # Errors
    /// As [`Scene::read`], but for reading.
    pub fn parse(path: &Path, text: &str) -> Result<Self, CommandError> {
        let source = Source { path, text };
        let raw: RawScene = toml::from_str(text)
            .map_err(|e| source.error(e.span().unwrap_or(0..text.len()), e.message()))?;
        check::scene(raw, &source)
    }
}
