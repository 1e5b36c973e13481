//! Which rotations are worth scoring.

use glam::DQuat;
use sdf_grid::Monitor;

use crate::dock::domain::SearchDomain;
use crate::dock::error::SearchError;
use crate::dock::options::SearchOptions;
use crate::dock::scan::{self, Scan};
use crate::dock::weights::with_weights;
use crate::geometry::half_turn::half_turn_groups;
use crate::pair::fields::Pair;
use crate::sweep::pair_energies::PairEnergies;

/// Interior weight over exterior weight of a sketch: on cells half as wide as the part, heavy
/// interiors punish the fit for the cells that its faces cut. Measured in `docs/docking.md`.
const RATIO: f64 = 4.0;

/// Rotations that go on at least.
const LEAST: usize = 128;

/// Of all rotations within this many steps of each other, the best go on, whatever others score: a
/// part that may lie flat anywhere on a large face does so in very many rotations, each of which
/// scores more on wide cells than a fit with little play.
const NEIGHBOURS: f64 = 1.75;

/// How many of them.
const BEST_OF_NEIGHBOURS: usize = 2;

/// Whether a search over this many rotations is worth a sketch: fewer go on than there are.
pub fn wants_sketch(rotations: usize) -> bool {
    rotations > 2 * LEAST
}

/// The rotations of a domain with the best scores, in the domain's order: a share of them, or
/// [`LEAST`], all that wide cells could have blurred so, and the best of each neighbourhood.
pub(super) fn sketch(
    pair: &Pair,
    domain: &SearchDomain,
    options: &SearchOptions,
    monitor: &dyn Monitor,
) -> Result<Vec<usize>, SearchError> {
    let pair = with_weights(pair, RATIO)?;
    let window = domain.window(pair.pivot(), pair.spacing())?;
    let groups = half_turn_groups(&domain.rotations);
    let scores = PairEnergies::plan_for_groups(&pair, &window, &groups)?;
    let scan = Scan {
        pair: &pair,
        scores: &scores,
        window: &window,
        per_rotation: 1,
        distance: pair.spacing(),
    };
    let count = domain.rotations.len();
    monitor.begin("sketching rotations", count as u64);
    let (mut found, scored) = scan.run(&groups, &(0..count), monitor);
    if scored < count {
        return Err(SearchError::Cancelled);
    }
    scan::sort(&mut found);
    let wanted = ((options.chosen_share * count as f64).ceil() as usize).max(LEAST);
    let blurred = (1.0 - options.blur) * found.first().map_or(0.0, |c| c.energy);
    let wanted = wanted.max(found.partition_point(|c| c.energy <= blurred));
    let rotations: Vec<DQuat> = (found.iter())
        .map(|c| domain.rotations[c.rotation])
        .collect();
    let near = (0.5 * NEIGHBOURS * domain.step).cos();
    let goes_on = |place: usize| {
        let better = rotations[..place].iter();
        let neighbours = better.filter(|q| q.dot(rotations[place]).abs() > near);
        place < wanted || neighbours.take(BEST_OF_NEIGHBOURS).count() < BEST_OF_NEIGHBOURS
    };
    let mut place = 0;
    found.retain(|_| {
        place += 1;
        goes_on(place - 1)
    });
    let mut chosen: Vec<usize> = found.iter().map(|c| c.rotation).collect();
    chosen.sort_unstable();
    Ok(chosen)
}
