//! Reading a scene file.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::error::SceneError;
use crate::file::check;
use crate::file::raw::RawScene;
use crate::file::values::Source;
use crate::scene::Scene;

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// If the file cannot be read, is not TOML, has an unknown key, or a value is out of range;
    /// the error carries the line.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = bounded(path).map_err(|source| SceneError::Read {
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
            .map_err(|e| source.error(e.span().unwrap_or(0..text.len()), worded(e.message())))?;
        check::scene(raw, source)
    }
}

/// What the parser says, in the words of the pages.
fn worded(said: &str) -> String {
    const WORDS: [(&str, &str); 5] = [
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
        ("unknown variant", "unknown word"),
        ("expected f64", "expected a number"),
        ("expected u32", "expected a whole number"),
    ];
    let parts = said.strip_prefix("invalid type: ");
    let said = match parts.and_then(|rest| rest.split_once(", expected ")) {
        Some((found, expected)) => format!("expected {expected}, found {found}"),
        None => said.to_owned(),
    };
    let reworded = |said: String, (from, to): (&str, &str)| said.replacen(from, to, 1);
    WORDS.into_iter().fold(said, reworded)
}

/// Bytes of a scene file at most: a hundred thousand listed rotations. What TOML makes of it takes
/// some seventy times as much.
const LONGEST: u64 = 4 << 20;

/// The text of a file, or of a pipe, that is not too long.
fn bounded(path: &Path) -> io::Result<String> {
    let mut text = Vec::new();
    File::open(path)?.take(LONGEST + 1).read_to_end(&mut text)?;
    if text.len() as u64 > LONGEST {
        return Err(io::Error::other("more than 4 MiB, which no scene has"));
    }
    String::from_utf8(text).map_err(io::Error::other)
}
