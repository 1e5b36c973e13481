//! Scoring the rotations of a search in batches, and the state file that keeps them, whole at any
//! moment.

use std::path::Path;
use web_time::Instant;

use sdf_grid::provenance::difference;
use sdf_grid::{Monitor, atomic, regular};
use serde::{Deserialize, Serialize};

use crate::dock::error::DockingError;
use crate::dock::options::SearchProvenance;
use crate::dock::peaks::{Candidate, Scan, sort_candidates};
use crate::geometry::half_turn::HalfTurnGroup;

/// Candidates kept of all rotations: far more than any later stage looks at.
const KEPT: usize = 4000;

/// Bytes of a state at most; a few hundred for each candidate, and its rotations.
const LONGEST: u64 = 1 << 24;

/// Rotations `0 .. scored` are done; the best candidates among them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    /// What the result depends on.
    pub(super) provenance: SearchProvenance,
    pub(super) scored: usize,
    /// Seconds of scoring.
    pub(super) seconds: f64,
    pub(super) candidates: Vec<Candidate>,
}

impl State {
    pub(super) fn new(provenance: SearchProvenance) -> Self {
        Self {
            provenance,
            scored: 0,
            seconds: 0.0,
            candidates: Vec::new(),
        }
    }

    /// What `path` holds, or a new state if there is no such file. Candidates outside the provenance's
    /// rotations and a window of `shape` nodes are refused.
    pub(super) fn load(
        path: &Path,
        provenance: SearchProvenance,
        shape: [usize; 3],
    ) -> Result<Self, DockingError> {
        let text = match regular::read(path, LONGEST) {
            Ok(Some(text)) => text,
            Ok(None) => return Ok(Self::new(provenance)),
            Err(e) => return Err(io(path, e.into())),
        };
        let format = |reason: String| DockingError::StateFormat {
            path: path.to_owned(),
            reason,
        };
        let state: Self = serde_json::from_slice(&text).map_err(|e| format(e.to_string()))?;
        if let Some(difference) = difference(&state.provenance, &provenance) {
            return Err(DockingError::OtherState {
                path: path.to_owned(),
                difference,
            });
        }
        let inside = |c: &Candidate| {
            c.rotation < state.scored
                && (0..3).all(|a| c.index[a] < shape[a])
                && c.energy.is_finite()
        };
        if state.scored > provenance.chosen.count || !state.candidates.iter().all(inside) {
            return Err(format("a number is out of range".into()));
        }
        Ok(state)
    }

    /// Adds the candidates of the next rotations; only the best of all are kept.
    pub(super) fn add(&mut self, mut candidates: Vec<Candidate>, scored: usize) {
        self.candidates.append(&mut candidates);
        sort_candidates(&mut self.candidates);
        self.candidates.truncate(KEPT);
        self.scored += scored;
    }

    /// Writes the state to `path`, whole or not at all.
    pub(super) fn save(&self, path: &Path) -> Result<(), DockingError> {
        let write =
            || -> std::io::Result<()> { Ok(atomic::write(path, &serde_json::to_vec(self)?)?) };
        write().map_err(|source| io(path, source))
    }
}

fn io(path: &Path, source: std::io::Error) -> DockingError {
    DockingError::StateFile {
        path: path.to_owned(),
        source,
    }
}

/// Rotations scored between two writes of the state.
pub(super) const BATCH: usize = 256;

/// Scores what is left to score of a search's chosen rotations; the state and how many rotations it
/// held before.
pub(super) fn score(
    scan: &Scan,
    groups: &[HalfTurnGroup],
    file: Option<&Path>,
    provenance: SearchProvenance,
    monitor: &dyn Monitor,
) -> Result<(State, usize), DockingError> {
    let count = provenance.chosen.count;
    let mut state = match file {
        Some(path) => State::load(path, provenance, scan.window.shape())?,
        None => State::new(provenance),
    };
    let resumed = state.scored;
    monitor.begin("scoring rotations", (count - resumed) as u64);
    while state.scored < count && !monitor.cancelled() {
        let began = Instant::now();
        let range = state.scored..(state.scored + BATCH).min(count);
        let (found, scored) = scan.run(groups, &range, monitor);
        // Which rotations of a batch that was cut short are done depends on the threads: a file
        // holds whole batches only.
        if file.is_some() && scored < range.len() {
            break;
        }
        state.add(found, scored);
        state.seconds += began.elapsed().as_secs_f64();
        if let Some(path) = file {
            state.save(path)?;
        }
    }
    if state.scored == 0 {
        return Err(DockingError::Cancelled);
    }
    Ok((state, resumed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dock::options::RotationList;
    use crate::dock::options::SearchOptions;
    use crate::pair::model::PairProvenance;
    use crate::pair::model::ScoreModel;
    use glam::DVec3;

    fn candidate(rotation: usize, energy: f64) -> Candidate {
        Candidate {
            rotation,
            index: [1, 2, 3],
            energy,
            half_width: None,
        }
    }

    fn provenance(rotations: usize, ratio: f64) -> SearchProvenance {
        let list = |count| RotationList {
            count,
            hash: "aa".into(),
        };
        let pair = PairProvenance::without_fields(ScoreModel::GUIDED, DVec3::ZERO);
        SearchProvenance {
            options: SearchOptions {
                ratio,
                ..SearchOptions::default()
            },
            screening: None,
            coarse: pair.clone(),
            fine: pair,
            places: [[0.0; 3]; 2],
            step: 0.1,
            rotations: list(9),
            chosen: list(rotations),
            symmetries: Vec::new(),
        }
    }

    #[test]
    fn a_state_survives_its_file_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.json");
        let load = |ratio: f64, shape| State::load(&path, provenance(5, ratio), shape);
        let mut state = load(12.0, [4; 3]).unwrap();
        assert_eq!(state.scored, 0);
        state.add(vec![candidate(1, -1.0), candidate(0, -2.0)], 2);
        assert_eq!(state.candidates[0].rotation, 0, "lowest first");
        state.save(&path).unwrap();
        assert_eq!(load(12.0, [4; 3]).unwrap(), state);
        let refused = load(11.0, [4; 3]).unwrap_err().to_string();
        assert!(
            refused.contains("options.ratio is 12.0 there, 11.0 here"),
            "{refused}"
        );
        let outside = load(12.0, [4, 4, 3]);
        assert!(matches!(outside, Err(DockingError::StateFormat { .. })));
        let mut many = state.clone();
        many.scored = 6;
        many.save(&path).unwrap();
        let too_many = load(12.0, [4; 3]);
        assert!(matches!(too_many, Err(DockingError::StateFormat { .. })));
        std::fs::write(&path, "{\"provenance\":").unwrap();
        assert!(matches!(
            load(12.0, [4; 3]),
            Err(DockingError::StateFormat { .. })
        ));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_the_best_are_kept() {
        let mut state = State::new(provenance(5000, 12.0));
        state.add((0..5000).map(|i| candidate(i, -(i as f64))).collect(), 5000);
        assert_eq!(state.candidates.len(), KEPT);
        assert_eq!(state.candidates[0].rotation, 4999);
    }
}
