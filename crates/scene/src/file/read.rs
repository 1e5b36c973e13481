//! Reading a scene file.

use std::path::Path;

use crate::error::SceneError;
use crate::file::check;
use crate::file::raw::RawScene;
use crate::file::source::Source;
use crate::scene::Scene;

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// If the file cannot be read, is not TOML, has an unknown key, or a value is out of range;
    /// the error carries the line.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &text)
    }

    /// Checks the text of a scene file; `path` is what meshes are relative to the folder of.
    ///
    /// # Errors
    /// As [`Scene::read`], but for reading.
    pub fn parse(path: impl AsRef<Path>, text: &str) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let source = Source { path, text };
        let raw: RawScene = toml::from_str(text)
            .map_err(|e| source.error(e.span().unwrap_or(0..text.len()), e.message()))?;
        check::scene(raw, source)
    }
}
