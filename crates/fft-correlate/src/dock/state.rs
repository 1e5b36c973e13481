//! What a docking search has done so far, in a file that is whole at any moment.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use crate::dock::scan::{Candidate, sort};

/// Candidates kept of all rotations: far more than any later stage looks at.
const KEPT: usize = 4000;

/// Why a search cannot go on from its file, or write it.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not a search's state.
    #[error("{path}: not the state of a docking search: {reason}", path = path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The file belongs to another search.
    #[error(
        "{path}: state of another search (parts, model or options differ): expected {expected}, \
         found {found}; delete it to start anew", path = path.display()
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// Fingerprint of this search.
        expected: String,
        /// Fingerprint in the file.
        found: String,
    },
}

/// Rotations `0 .. scored` are done; the best candidates among them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    /// Of everything that the candidates depend on.
    pub(super) fingerprint: String,
    pub(super) scored: usize,
    /// Seconds of scoring.
    pub(super) seconds: f64,
    pub(super) candidates: Vec<Candidate>,
}

impl State {
    pub(super) fn new(fingerprint: String) -> Self {
        Self {
            fingerprint,
            scored: 0,
            seconds: 0.0,
            candidates: Vec::new(),
        }
    }

    /// What `path` holds, or a new state if there is no such file. `rotations` and `shape` are
    /// those of this search: candidates outside them are refused.
    pub(super) fn load(
        path: &Path,
        fingerprint: String,
        rotations: usize,
        shape: [usize; 3],
    ) -> Result<Self, StateError> {
        let text = match std::fs::read(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Self::new(fingerprint));
            }
            Err(source) => return Err(io(path, source)),
        };
        let format = |reason: String| StateError::Format {
            path: path.to_owned(),
            reason,
        };
        let state: Self = serde_json::from_slice(&text).map_err(|e| format(e.to_string()))?;
        if state.fingerprint != fingerprint {
            return Err(StateError::Other {
                path: path.to_owned(),
                expected: fingerprint,
                found: state.fingerprint,
            });
        }
        let inside = |c: &Candidate| {
            c.rotation < state.scored
                && (0..3).all(|a| c.index[a] < shape[a])
                && c.energy.is_finite()
        };
        if state.scored > rotations || !state.candidates.iter().all(inside) {
            return Err(format("a number is out of range".into()));
        }
        Ok(state)
    }

    /// Adds the candidates of the next rotations; only the best of all are kept.
    pub(super) fn add(&mut self, mut candidates: Vec<Candidate>, scored: usize) {
        self.candidates.append(&mut candidates);
        sort(&mut self.candidates);
        self.candidates.truncate(KEPT);
        self.scored += scored;
    }

    /// Writes the state beside `path`, syncs it and renames it into place.
    pub(super) fn save(&self, path: &Path) -> Result<(), StateError> {
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let write = || -> std::io::Result<()> {
            let mut file = NamedTempFile::new_in(folder)?;
            serde_json::to_writer(std::io::BufWriter::new(&mut file), self)?;
            file.flush()?;
            file.as_file().sync_all()?;
            file.persist(path).map_err(|e| e.error)?;
            Ok(())
        };
        write().map_err(|source| io(path, source))
    }
}

fn io(path: &Path, source: std::io::Error) -> StateError {
    StateError::Io {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(rotation: usize, energy: f64) -> Candidate {
        Candidate {
            rotation,
            index: [1, 2, 3],
            energy,
            half_width: None,
        }
    }

    #[test]
    fn a_state_survives_its_file_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.json");
        let load =
            |print: &str, rotations, shape| State::load(&path, print.to_owned(), rotations, shape);
        let mut state = load("a", 5, [4; 3]).unwrap();
        assert_eq!(state.scored, 0);
        state.add(vec![candidate(1, -1.0), candidate(0, -2.0)], 2);
        assert_eq!(state.candidates[0].rotation, 0, "lowest first");
        state.save(&path).unwrap();
        assert_eq!(load("a", 5, [4; 3]).unwrap(), state);
        assert!(matches!(
            load("b", 5, [4; 3]),
            Err(StateError::Other { .. })
        ));
        for (rotations, shape) in [(1, [4; 3]), (5, [4, 4, 3])] {
            let refused = load("a", rotations, shape);
            assert!(matches!(refused, Err(StateError::Format { .. })));
        }
        std::fs::write(&path, "{\"fingerprint\":").unwrap();
        assert!(matches!(
            load("a", 5, [4; 3]),
            Err(StateError::Format { .. })
        ));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_the_best_are_kept() {
        let mut state = State::new(String::new());
        state.add((0..5000).map(|i| candidate(i, -(i as f64))).collect(), 5000);
        assert_eq!(state.candidates.len(), KEPT);
        assert_eq!(state.candidates[0].rotation, 4999);
    }
}
