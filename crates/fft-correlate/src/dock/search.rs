//! The search of docking, in stages:
//!
//! 0. **Screening**, where there are many rotations: every one, all translations at once, on a lattice
//!    of wide cells and with lighter interiors; the best go on.
//! 1. **Scoring.** Their translations, all at once, on a coarse lattice; the best local maxima of
//!    each are kept. Scores are of cell averages, which blur a fit by how faces happen to lie in the
//!    cells: all distinct poses as deep as the lowest up to that blur are candidates.
//! 2. **Coarse descent.** Candidates go downhill with the direct evaluator on smoothed densities and
//!    contact, on a lattice somewhat coarser than the fine one; rotation included: between the
//!    rotations scored, the rest of the way. A few steps tell which are worth more.
//! 3. **Fine descent.** The lowest distinct ones of these go downhill on the fine lattice with every
//!    cell its own point, whose energy ranks them.
//! 4. **Decision**, by [`rerank`] and only if poses are too close to call: those go downhill
//!    once more on a lattice of half the spacing.
//!
//! All stages but the screening weigh the interiors [`crate::dock::DOCKING_RATIO`] times the
//! exteriors, or as the model does if that is more, and leave separation out. A force that a hand
//! is to feel wants lighter interiors: walls that yield a little, a wide funnel. The best place
//! wants heavier ones: with 5 : 1, a peg gains more along the walls of a blind hole than it pays
//! for sticking through a thin floor. Measured in `docs/docking.md`.

use std::path::Path;
use web_time::Instant;

use glam::DQuat;
use sdf_grid::Monitor;

use crate::dock::error::DockingError;
use crate::dock::local_refinement::{
    Effort, Evaluators, FoundPose, LocalRefinement, SCORING, SearchResult, SearchStage, sort_poses,
};
use crate::dock::options::{
    SearchDomain, SearchOptions, SearchPairs, SearchProvenance, with_docking_weights, with_weights,
};
use crate::dock::peaks::{Candidate, Scan, sort_candidates};
use crate::dock::state::score;
use crate::geometry::half_turn::half_turn_groups;
use crate::pair::fields::Pair;
use crate::sweep::PairEnergies;

/// Searches `domain`; only gamma is taken from the pairs' models. With `state`, what was scored is
/// kept in that file after every batch of rotations, and a file that is already there is gone on
/// with; the screening is done again. When the monitor cancels, the best of what was scored is
/// returned unrefined. The result does not depend on the number of threads, nor on where a search
/// was interrupted.
///
/// # Errors
/// If there is no rotation or one is not a unit quaternion, the window cannot be correlated, the
/// weights are out of range, a part has no interior on a lattice, the state file is unusable or of
/// another search, or the monitor cancels before any rotation is scored.
pub fn search(
    pairs: &SearchPairs,
    domain: &SearchDomain,
    options: &SearchOptions,
    state: Option<&Path>,
    monitor: &dyn Monitor,
) -> Result<SearchResult, DockingError> {
    domain.check()?;
    pairs.check()?;
    // Screening chooses rotations.
    let mut stages = Stages(Vec::new());
    let chosen = choose_rotations(pairs, domain, options, &mut stages, monitor)?;
    let rotations: Vec<DQuat> = chosen.iter().map(|i| domain.rotations[*i]).collect();
    // Scoring: the local maxima of every chosen rotation, on the coarse lattice.
    let coarse = with_docking_weights(pairs.coarse, options.ratio)?;
    let fine = with_docking_weights(pairs.fine, options.ratio)?;
    let window = domain.window(coarse.pivot(), coarse.spacing())?;
    let groups = half_turn_groups(&rotations);
    let scores = PairEnergies::plan_for_groups(&coarse, &window, &groups)?;
    let scan = Scan {
        pair: &coarse,
        scores: &scores,
        window: &window,
        per_rotation: options.per_rotation,
        distance: 2.0 * coarse.spacing(),
    };
    let provenance = SearchProvenance::new(
        domain,
        options,
        pairs.screening,
        [&coarse, &fine],
        &rotations,
    );
    let (done, resumed) = score(&scan, &groups, state, provenance, monitor)?;
    stages.0.push(SearchStage {
        name: SCORING,
        items: done.scored,
        seconds: done.seconds,
    });
    // Local refinement of the distinct poses that may lead to the deepest.
    let refinement = LocalRefinement::new(&coarse, domain, options, monitor)?;
    let candidates = done.candidates.iter();
    let poses: Vec<_> = candidates
        .map(|c| lattice_pose(&scan, &rotations, c))
        .collect();
    let apart = (0.7 * domain.step, 2.0 * coarse.spacing());
    let mut poses = refinement.distinct(&poses, apart, options.coarse_poses);
    poses.truncate(count_promising(&poses, options));
    if monitor.cancelled() {
        poses.truncate(options.top);
    } else {
        poses = refine_on_both_levels(poses, [&coarse, &fine], &refinement, &mut stages)?;
    }
    for p in &mut poses {
        p.rotation = chosen[p.rotation];
    }
    Ok(SearchResult {
        poses,
        scored: done.scored,
        chosen: chosen.len(),
        rotations: domain.rotations.len(),
        resumed,
        window: window.shape(),
        transform_size: scores.correlator().plan().transform_size,
        model: *coarse.model(),
        stages: stages.0,
    })
}

/// What was done, in order.
struct Stages(Vec<SearchStage>);

impl Stages {
    /// Does `work` on `items` things and notes how long it took.
    fn run<T>(&mut self, name: &'static str, items: usize, work: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let result = work();
        self.0.push(SearchStage {
            name,
            items,
            seconds: began.elapsed().as_secs_f64(),
        });
        result
    }
}

/// Indices of the rotations to score: those that a screening chooses; without one, or if none of its
/// scores has a maximum, all.
fn choose_rotations(
    pairs: &SearchPairs,
    domain: &SearchDomain,
    options: &SearchOptions,
    stages: &mut Stages,
    monitor: &dyn Monitor,
) -> Result<Vec<usize>, DockingError> {
    let count = domain.rotations.len();
    let chosen = match pairs.screening {
        Some(pair) if needs_screening(count) => stages.run("sketch", count, || {
            screen_rotations(pair, domain, options, monitor)
        })?,
        _ => Vec::new(),
    };
    Ok(match chosen.is_empty() {
        true => (0..count).collect(),
        false => chosen,
    })
}

/// Coarse and fine descent.
fn refine_on_both_levels(
    poses: Vec<FoundPose>,
    [coarse, fine]: [&Pair; 2],
    refinement: &LocalRefinement<'_>,
    stages: &mut Stages,
) -> Result<Vec<FoundPose>, DockingError> {
    let LocalRefinement {
        options, monitor, ..
    } = refinement;
    let count = options.fine_poses.max(options.top);
    let name = "coarse descent";
    monitor.begin(name, poses.len() as u64);
    let (poses, sources) = stages.run(name, poses.len(), || {
        let sources = Evaluators::new(fine)?;
        let near = [sources.coarse()];
        let begun = refinement.descend(poses, coarse, &near, Effort::FIRST, options.going_on());
        monitor.begin(name, begun.len() as u64);
        let poses = refinement.descend(begun, coarse, &near, Effort::COARSE, count);
        Ok::<_, DockingError>((poses, sources))
    })?;
    let name = "fine descent";
    monitor.begin(name, poses.len() as u64);
    Ok(stages.run(name, poses.len(), || {
        let poses = refinement.descend(poses, fine, &[sources.full()], Effort::FINE, count);
        refinement.finish(poses, sources.full())
    }))
}

/// How many of the poses, lowest energy first, may lead to the deepest: those that the coarse
/// lattice could have blurred so, but at least twice as many as go on from the first steps.
fn count_promising(poses: &[FoundPose], options: &SearchOptions) -> usize {
    let lowest = poses.first().map_or(0.0, |p| p.energy);
    let near = |p: &FoundPose| p.energy <= (1.0 - options.blur) * lowest;
    poses
        .partition_point(near)
        .max(2 * options.going_on())
        .min(poses.len())
}

fn lattice_pose(scan: &Scan, rotations: &[DQuat], candidate: &Candidate) -> FoundPose {
    FoundPose {
        pose: scan.pose(rotations, candidate),
        energy: candidate.energy,
        refined: false,
        half_width: candidate.half_width,
        rotation: candidate.rotation,
        lattice_energy: candidate.energy,
    }
}

/// Interior weight over exterior weight of a screening: on cells half as wide as the part, heavy
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

/// Whether a search over this many rotations is worth a screening: fewer go on than there are.
pub(super) fn needs_screening(rotations: usize) -> bool {
    rotations > 2 * LEAST
}

/// The rotations of a domain with the best scores, in the domain's order: a share of them, or
/// [`LEAST`], all that wide cells could have blurred so, and the best of each neighbourhood.
fn screen_rotations(
    pair: &Pair,
    domain: &SearchDomain,
    options: &SearchOptions,
    monitor: &dyn Monitor,
) -> Result<Vec<usize>, DockingError> {
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
        return Err(DockingError::Cancelled);
    }
    // As many as asked for, and all that wide cells could have blurred to their depth.
    sort_candidates(&mut found);
    let wanted = ((options.chosen_share * count as f64).ceil() as usize).max(LEAST);
    let blurred = (1.0 - options.blur) * found.first().map_or(0.0, |c| c.energy);
    let wanted = wanted.max(found.partition_point(|c| c.energy <= blurred));
    // The best of each neighbourhood as well.
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

/// Ranks poses anew that a search left too close to call ([`SearchResult::close`]): they are refined
/// on the lattice of `finer`, and all poses take energy and width from it. `finer` is the pair of
/// the same parts and pivot, usually on half the spacing; `domain` and `options` are the search's.
/// When the monitor cancels, the result stays as it is.
///
/// # Errors
/// If the weights are out of range or a part has no interior on the lattice.
pub(super) fn rerank(
    report: &mut SearchResult,
    finer: &Pair,
    domain: &SearchDomain,
    options: &SearchOptions,
    monitor: &dyn Monitor,
) -> Result<(), DockingError> {
    let began = Instant::now();
    let finer = with_docking_weights(finer, options.ratio)?;
    let refinement = LocalRefinement::new(&finer, domain, options, monitor)?;
    let sources = Evaluators::new(&finer)?;
    let (coarse, full) = (sources.coarse(), sources.full());
    let (close, rest) = report.poses.split_at(report.close());
    monitor.begin("decision", close.len() as u64);
    let mut poses = refinement.descend(
        close.to_vec(),
        &finer,
        &[coarse, full],
        Effort::FINE,
        close.len(),
    );
    poses.extend(rest.iter().map(|p| FoundPose {
        energy: full.evaluate_full(&p.pose).response.energy,
        ..*p
    }));
    sort_poses(&mut poses);
    let poses = refinement.finish(poses, full);
    if !monitor.cancelled() {
        report.stages.push(SearchStage {
            name: "decision",
            items: close.len(),
            seconds: began.elapsed().as_secs_f64(),
        });
        report.poses = poses;
    }
    Ok(())
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
