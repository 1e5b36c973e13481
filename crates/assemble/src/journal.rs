//! A file of what a search has found, from which the same search goes on after an interruption.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use sdf_grid::{Monitor, regular};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::AssemblyError;
use crate::request::LoosePart;

/// Bytes of such a file that are read, at most.
const LONGEST: u64 = 1 << 30;

/// Characters of a key, of a check, and of the head's digest.
const KEY: usize = 32;

/// Questions of a search with their answers: which places two shapes have on each other, and where a
/// shape can be added to a subassembly. Equal questions have equal answers, so a search that asks them
/// again goes on where it stopped.
///
/// The first line names the parts; every other line is a key, a check and an answer in JSON.
#[derive(Debug, Default)]
pub(crate) struct Journal {
    known: HashMap<String, String>,
    file: Option<(PathBuf, Mutex<File>)>,
}

impl Journal {
    /// Reads a file if it exists, and keeps it open for what is found from now on.
    pub(crate) fn open(
        path: &Path,
        parts: &[LoosePart],
        clearance: Option<f64>,
    ) -> Result<Self, AssemblyError> {
        let failed = |error: std::io::Error| AssemblyError::Journal {
            file: path.to_owned(),
            expected: "a file that can be read and written".into(),
            found: error.to_string(),
        };
        let head = format!("pegfit assembly 1 {}", digest_of(parts, clearance));
        let bytes = regular::read(path, LONGEST).map_err(|e| failed(e.into()))?;
        let known = match &bytes {
            Some(bytes) => parse(bytes, &head).map_err(|(expected, found)| {
                let file = path.to_owned();
                AssemblyError::Journal {
                    file,
                    expected,
                    found,
                }
            })?,
            None => HashMap::new(),
        };
        let mut file = (OpenOptions::new().create(true).append(true).open(path)).map_err(failed)?;
        // A line that was cut off by the end of the last run is found again.
        let whole = bytes.as_ref().map_or(0, |bytes| whole_lines(bytes).len());
        file.set_len(whole as u64).map_err(failed)?;
        if whole == 0 {
            writeln!(file, "{head}").map_err(failed)?;
        }
        let file = Some((path.to_owned(), Mutex::new(file)));
        Ok(Self { known, file })
    }

    /// What is known of a question, or else what `find` finds; that is written down unless the monitor
    /// has cancelled it.
    pub(crate) fn recall<T: Serialize + DeserializeOwned>(
        &self,
        question: &impl Serialize,
        monitor: &dyn Monitor,
        find: impl FnOnce() -> T,
    ) -> T {
        let Some((path, file)) = &self.file else {
            return find();
        };
        let key = key(question);
        let known = self.known.get(&key);
        if let Some(answer) = known.and_then(|text| serde_json::from_str(text).ok()) {
            return answer;
        }
        let answer = find();
        if !monitor.cancelled() {
            let text = serde_json::to_string(&answer).unwrap_or_default();
            let line = format!("{key} {} {text}\n", check(&key, &text));
            let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
            if let Err(error) = file.write_all(line.as_bytes()) {
                let file = path.display();
                tracing::warn!(%file, %error, "what was found is not kept for --resume");
            }
        }
        answer
    }
}

/// The key of a question.
pub(crate) fn key(question: &impl Serialize) -> String {
    let text = serde_json::to_vec(question).unwrap_or_default();
    blake3::hash(&text).to_hex()[..KEY].to_owned()
}

fn check(key: &str, text: &str) -> String {
    let hash = blake3::Hasher::new()
        .update(key.as_bytes())
        .update(text.as_bytes())
        .finalize();
    hash.to_hex()[..KEY].to_owned()
}

/// A digest of all that answers depend on and that questions do not name.
fn digest_of(parts: &[LoosePart], clearance: Option<f64>) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(env!("CARGO_PKG_VERSION").as_bytes());
    hasher.update(&clearance.unwrap_or(-1.0).to_le_bytes());
    for part in parts {
        let corners = part.mesh.faces().flatten();
        for coordinate in corners.flat_map(|corner| corner.to_array()) {
            hasher.update(&coordinate.to_le_bytes());
        }
        hasher.update(&[0]);
    }
    hasher.finalize().to_hex()[..KEY].to_owned()
}

/// The bytes up to the last end of a line.
fn whole_lines(bytes: &[u8]) -> &[u8] {
    let end = bytes
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |at| at + 1);
    &bytes[..end]
}

/// The answers of a file by their keys; or what was expected and what was found instead.
fn parse(bytes: &[u8], head: &str) -> Result<HashMap<String, String>, (String, String)> {
    let text = std::str::from_utf8(whole_lines(bytes))
        .map_err(|_| ("text in UTF-8".to_owned(), "other bytes".to_owned()))?;
    let mut lines = text.lines();
    match lines.next() {
        None if bytes.is_empty() => return Ok(HashMap::new()),
        Some(found) if found == head => {}
        _ => {
            let expected = "what a search of the same parts has found, with the same \
                            mating clearance and version";
            return Err((expected.to_owned(), "something else".to_owned()));
        }
    }
    let mut known = HashMap::new();
    for (number, line) in lines.enumerate() {
        let mut words = line.splitn(3, ' ');
        let (key, checked) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
        let text = words.next().unwrap_or("");
        if checked != check(key, text) {
            let expected = format!("line {} as it was written", number + 2);
            return Err((expected, "a changed line".to_owned()));
        }
        known.insert(key.to_owned(), text.to_owned());
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::Arc;

    use glam::DVec3;
    use sdf_grid::{Silent, shapes::cuboid};

    use super::*;

    /// Cancels.
    struct Stopped;

    impl Monitor for Stopped {
        fn cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn answers_outlive_an_interruption_and_changed_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("search.journal");
        let part = |size: f64| LoosePart {
            name: "cube".into(),
            mesh: Arc::new(cuboid(DVec3::splat(size)).unwrap()),
        };
        let parts = [part(0.01), part(0.02)];
        let open = || Journal::open(&path, &parts, None);
        let asked = Cell::new(0);
        let find = || {
            asked.set(asked.get() + 1);
            0.1 + 0.2
        };
        let journal = open().unwrap();
        // What was cancelled is not kept.
        journal.recall(&("a", 1), &Stopped, find);
        assert_eq!(journal.recall(&("a", 1), &Silent, find), 0.1 + 0.2);
        assert_eq!(asked.get(), 2);
        drop(journal);
        // A kill in the middle of a line.
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole[..], b"abc def"].concat()).unwrap();
        let journal = open().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        assert_eq!(journal.recall(&("a", 1), &Silent, find), 0.1 + 0.2);
        assert_eq!(asked.get(), 2);
        journal.recall(&("a", 2), &Silent, find);
        assert_eq!(asked.get(), 3);
        drop(journal);
        let refused = |parts: &[LoosePart], clearance| {
            let error = Journal::open(&path, parts, clearance).unwrap_err();
            error.to_string()
        };
        assert!(refused(&parts[..1], None).contains("same parts"));
        assert!(refused(&parts, Some(1e-4)).contains("same parts"));
        let text = std::fs::read_to_string(&path).unwrap();
        let changed = text.replacen("0.30000000000000004", "0.40000000000000004", 1);
        std::fs::write(&path, changed).unwrap();
        assert!(refused(&parts, None).contains("line 2"));
        std::fs::write(&path, [0xff, b'\n']).unwrap();
        assert!(refused(&parts, None).contains("UTF-8"));
    }
}
