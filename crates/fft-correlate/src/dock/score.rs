//! Scoring all rotations of a search, in batches that a state file keeps.

use std::path::Path;
use std::time::Instant;

use sdf_grid::Monitor;

use crate::dock::error::SearchError;
use crate::dock::recipe::SearchRecipe;
use crate::dock::scan::Scan;
use crate::dock::state::State;
use crate::geometry::half_turn::HalfTurnGroup;

/// Rotations scored between two writes of the state.
pub(super) const BATCH: usize = 256;

/// Scores what is left to score of a search's chosen rotations; the state and how many rotations it
/// held before.
pub(super) fn score(
    scan: &Scan,
    groups: &[HalfTurnGroup],
    file: Option<&Path>,
    recipe: SearchRecipe,
    monitor: &dyn Monitor,
) -> Result<(State, usize), SearchError> {
    let count = recipe.chosen.count;
    let mut state = match file {
        Some(path) => State::load(path, recipe, scan.window.shape())?,
        None => State::new(recipe),
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
        return Err(SearchError::Cancelled);
    }
    Ok((state, resumed))
}
