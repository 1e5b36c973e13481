//! The docking product: where does the moving part belong?
//!
//! 0. **Sketch**, where there are many rotations: every one, all translations at once, on a lattice of
//!    twice the coarse spacing and with lighter interiors; the best go on.
//! 1. **Scoring.** Their translations, all at once, on a coarse lattice; the best local maxima of each are
//!    kept.
//! 2. **Coarse descent.** The lowest distinct ones go downhill with the direct evaluator on the
//!    coarse lattice, rotation included: between the rotations scored, the rest of the way.
//! 3. **Fine descent.** The lowest distinct ones of these go downhill on the fine lattice with
//!    merged points, and once more with every cell its own point, whose energy ranks them.
//! 4. **Decision**, by [`decide`] and only if poses are too close to call: those go downhill once
//!    more on a lattice of half the spacing.
//!
//! All stages but the sketch weigh the interiors [`DOCKING_RATIO`] times the exteriors, or as the model does if
//! that is more, and leave separation out. A force that a hand is to feel wants lighter interiors:
//! walls that yield a little, a wide funnel. The best place wants heavier ones: with 5 : 1, a peg
//! gains more along the walls of a blind hole than it pays for sticking through a thin floor.
//! Measured in `docs/docking.md`.

use std::path::Path;
use std::time::Instant;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use sdf_grid::{Aabb, Monitor};
use serde::Serialize;

use super::report::{FoundPose, SCORING, SearchReport, SearchStage};
use super::scan::{Candidate, Scan};
use super::sketch::{sketch, wants_sketch};
use super::state::{State, StateError};
use super::{DockError, check_rotations, covers, measure};
use crate::peaks::PoseSpacing;
use crate::refine::Descent;
use crate::{
    Correlator, DirectError, DirectEvaluator, DirectOptions, EnergySource, HalfTurnGroup, Pair,
    PairError, Pose, ScoreModel, TranslationWindow, half_turn_groups,
};

/// Interior weight over exterior weight with which poses are found and ranked.
pub const DOCKING_RATIO: f64 = 12.0;

/// Rotations scored between two writes of the state.
const BATCH: usize = 256;

/// Points of the direct evaluator that descends on the fine lattice.
const FINE_POINTS: usize = 40_000;

/// How a search proceeds. The default suits parts of a few hundred cells' volume and more.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SearchOptions {
    /// Poses to return, at most.
    pub top: usize,
    /// Local maxima kept of each rotation.
    pub per_rotation: usize,
    /// Share of the rotations that goes on from the sketch, 0 ..= 1.
    pub chosen_share: f64,
    /// Distinct poses that descend on the coarse lattice.
    pub coarse_poses: usize,
    /// Distinct poses that descend on the fine lattice; at least `top`.
    pub fine_poses: usize,
    /// Interior weight over exterior weight; [`DOCKING_RATIO`] unless there is a reason.
    pub ratio: f64,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            top: 10,
            per_rotation: 4,
            chosen_share: 0.15,
            coarse_poses: 100,
            fine_poses: 16,
            ratio: DOCKING_RATIO,
        }
    }
}

/// Where a search looks.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchDomain {
    /// Rotations scored (unit quaternions), for example by [`super::search_rotations`].
    pub rotations: Vec<DQuat>,
    /// Angle between neighbouring rotations, radians.
    pub step: f64,
    /// Where the moving part's pivot may be, metres, fixed frame.
    pub places: Aabb,
    /// Motions that map the moving part onto itself ([`super::symmetry_group`]): poses that differ
    /// by one count as the same.
    pub symmetries: Vec<Pose>,
}

/// The parts of a search on its lattices, with one pivot ([`super::SearchLattices::plans`]).
#[derive(Debug, Clone, Copy)]
pub struct SearchPairs<'a> {
    /// Where rotations are chosen ([`super::wants_sketch`]); none if all are to be scored.
    pub sketch: Option<&'a Pair>,
    /// Where rotations are scored.
    pub coarse: &'a Pair,
    /// Where poses are refined and ranked.
    pub fine: &'a Pair,
}

impl SearchDomain {
    /// The displacements to score for a pair.
    pub(super) fn window(&self, pair: &Pair) -> Result<TranslationWindow, sdf_grid::LatticeError> {
        let pivot = pair.pivot();
        let (min, max) = (self.places.min - pivot, self.places.max - pivot);
        TranslationWindow::new(min, max, pair.spacing())
    }
}

/// Why a search cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// Scoring failed or was cancelled before the first rotation.
    #[error(transparent)]
    Dock(#[from] DockError),
    /// The translations do not make a window.
    #[error("translations to search: {0}")]
    Window(#[from] sdf_grid::LatticeError),
    /// The docking weights are out of range.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A pair has no direct evaluator.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The state file.
    #[error(transparent)]
    State(#[from] StateError),
    /// Two pairs are not of the same parts.
    #[error("the pairs of a search must have one pivot, found {coarse} and {other}")]
    Pivots {
        /// The coarse pair's, metres.
        coarse: DVec3,
        /// Another pair's, metres.
        other: DVec3,
    },
}

/// Searches `domain`; only gamma is taken from the pairs' models. With `state`, what was scored is kept in
/// that file after every batch of rotations, and a file that is already there is gone on with; the sketch is
/// done again. When the monitor cancels, the best of what was scored is returned unrefined. The result does
/// not depend on the number of threads, nor on where a search was interrupted.
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
) -> Result<SearchReport, SearchError> {
    check_rotations(&domain.rotations)?;
    let pivot = pairs.coarse.pivot();
    let others = pairs.sketch.into_iter().chain([pairs.fine]);
    if let Some(other) = others.map(Pair::pivot).find(|p| *p != pivot) {
        return Err(SearchError::Pivots {
            coarse: pivot,
            other,
        });
    }
    let mut stages = Vec::new();
    let mut chosen: Vec<usize> = match pairs.sketch {
        Some(pair) if wants_sketch(domain.rotations.len()) => {
            let began = Instant::now();
            let chosen = sketch(pair, domain, options.chosen_share, monitor)?;
            stages.push(SearchStage {
                name: "sketch",
                items: domain.rotations.len(),
                seconds: began.elapsed().as_secs_f64(),
            });
            chosen
        }
        _ => Vec::new(),
    };
    // Without a sketch, or if none of its scores has a maximum, all of them.
    if chosen.is_empty() {
        chosen = (0..domain.rotations.len()).collect();
    }
    let rotations: Vec<DQuat> = chosen.iter().map(|i| domain.rotations[*i]).collect();
    let coarse = with_docking_weights(pairs.coarse, options.ratio)?;
    let fine = with_docking_weights(pairs.fine, options.ratio)?;
    let window = domain.window(&coarse)?;
    let groups = half_turn_groups(&rotations);
    let correlator = Correlator::plan_groups(&coarse, &window, &groups).map_err(DockError::from)?;
    let scan = Scan {
        pair: &coarse,
        correlator: &correlator,
        window: &window,
        per_rotation: options.per_rotation,
        distance: 2.0 * coarse.spacing(),
    };
    let search = Search {
        domain,
        rotations: &rotations,
        options,
        window: &window,
        pivot,
        radius: super::radius_about_pivot(coarse.moving(), &coarse),
        monitor,
    };
    let (done, resumed) = search.score(&scan, &groups, state)?;
    stages.push(SearchStage {
        name: SCORING,
        items: done.scored,
        seconds: done.seconds,
    });
    let mut poses = search.lattice_poses(&scan, &done.candidates);
    if monitor.cancelled() {
        poses.truncate(options.top);
    } else {
        let mut stage = |name, poses: Vec<FoundPose>, work: &dyn Fn(Vec<FoundPose>) -> _| {
            let (began, items) = (Instant::now(), poses.len());
            monitor.begin(name, items as u64);
            let poses: Vec<FoundPose> = work(poses);
            stages.push(SearchStage {
                name,
                items,
                seconds: began.elapsed().as_secs_f64(),
            });
            poses
        };
        let source = DirectEvaluator::new(&coarse, &DirectOptions::FULL)?;
        let count = options.fine_poses.max(options.top);
        poses = stage("coarse descent", poses, &|poses| {
            search.descend(poses, &coarse, &[&source], count)
        });
        let [merged, source] = fine_sources(&fine)?;
        poses = stage("fine descent", poses, &|poses| {
            let poses = search.descend(poses, &fine, &[&merged, &source], count);
            search.finish(poses, &fine, &source)
        });
    }
    for p in &mut poses {
        p.rotation = chosen[p.rotation];
    }
    Ok(SearchReport {
        poses,
        scored: done.scored,
        chosen: chosen.len(),
        rotations: domain.rotations.len(),
        resumed,
        window: window.shape(),
        transform_size: correlator.description().transform_size,
        model: *coarse.model(),
        stages,
    })
}

/// Ranks the poses of a search anew where it left them too close to call ([`SearchReport::close`]):
/// those go downhill on the lattice of `finer`, and all take their energy, width and overlap from
/// it. `finer` is the same parts with the search's pivot, usually on half the spacing
/// ([`super::SearchLattices::deciding_plan`]); `domain` and `options` are the search's. When the
/// monitor cancels, the report stays as it is.
///
/// # Errors
/// If the weights are out of range or a part has no interior on the lattice.
pub fn decide(
    report: &mut SearchReport,
    finer: &Pair,
    domain: &SearchDomain,
    options: &SearchOptions,
    monitor: &dyn Monitor,
) -> Result<(), SearchError> {
    let began = Instant::now();
    let finer = with_docking_weights(finer, options.ratio)?;
    let pivot = finer.pivot();
    let window = domain.window(&finer)?;
    let search = Search {
        domain,
        rotations: &[],
        options,
        window: &window,
        pivot,
        radius: super::radius_about_pivot(finer.moving(), &finer),
        monitor,
    };
    let [merged, source] = fine_sources(&finer)?;
    let (close, rest) = report.poses.split_at(report.close());
    monitor.begin("decision", close.len() as u64);
    let mut poses = search.descend(close.to_vec(), &finer, &[&merged, &source], close.len());
    poses.extend(rest.iter().map(|p| FoundPose {
        energy: source.evaluate_full(&p.pose).response.energy,
        ..*p
    }));
    sort(&mut poses);
    let poses = search.finish(poses, &finer, &source);
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

/// The evaluators that descend one after the other on a fine lattice: merged points, every cell.
fn fine_sources(pair: &Pair) -> Result<[DirectEvaluator; 2], DirectError> {
    let merged = DirectOptions {
        max_points: Some(FINE_POINTS),
        ..DirectOptions::REAL_TIME
    };
    Ok([
        DirectEvaluator::new(pair, &merged)?,
        DirectEvaluator::new(pair, &DirectOptions::FULL)?,
    ])
}

/// Refined poses first, the lowest energy first among each: energies of different lattices differ a
/// little.
fn sort(poses: &mut [FoundPose]) {
    poses.sort_by(|a, b| {
        let order = a.energy.total_cmp(&b.energy);
        b.refined.cmp(&a.refined).then(order)
    });
}

/// The pair under the docking weights: interiors at least `ratio` times as heavy as exteriors, no
/// separation.
fn with_docking_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    let model = pair.model();
    let own = model.lambda_interior / model.lambda_exterior;
    with_weights(pair, ratio.max(own))
}

/// The pair with interiors `ratio` times as heavy as exteriors and no separation.
pub(super) fn with_weights(pair: &Pair, ratio: f64) -> Result<Pair, PairError> {
    let model = pair.model();
    pair.with_model(ScoreModel {
        lambda_interior: ratio * model.lambda_exterior,
        separation_weight: 0.0,
        ..*model
    })
}

struct Search<'a> {
    domain: &'a SearchDomain,
    /// Those to score, of the domain's.
    rotations: &'a [DQuat],
    options: &'a SearchOptions,
    window: &'a TranslationWindow,
    pivot: DVec3,
    /// Of the moving part about the pivot, metres.
    radius: f64,
    monitor: &'a dyn Monitor,
}

impl Search<'_> {
    /// Scores what is left to score; the state and how many rotations it held before.
    fn score(
        &self,
        scan: &Scan,
        groups: &[HalfTurnGroup],
        file: Option<&Path>,
    ) -> Result<(State, usize), SearchError> {
        let rotations = self.rotations;
        let print = self.fingerprint(scan.pair);
        let mut state = match file {
            Some(path) => State::load(path, print, rotations.len(), self.window.shape())?,
            None => State::new(print),
        };
        let resumed = state.scored;
        self.monitor
            .begin("scoring rotations", (rotations.len() - resumed) as u64);
        while state.scored < rotations.len() && !self.monitor.cancelled() {
            let began = Instant::now();
            let range = state.scored..(state.scored + BATCH).min(rotations.len());
            let (found, scored) = scan.run(groups, &range, self.monitor);
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
            return Err(DockError::Cancelled.into());
        }
        Ok((state, resumed))
    }

    /// A hash of everything that the candidates depend on.
    fn fingerprint(&self, pair: &Pair) -> String {
        let model = pair.model();
        let mut numbers = vec![
            model.sigma,
            model.lambda_exterior,
            model.lambda_interior,
            model.gamma,
            pair.spacing(),
            self.options.per_rotation as f64,
        ];
        for field in [pair.fixed(), pair.moving()] {
            numbers.extend([field.recipe.halo, f64::from(field.recipe.sampling as u8)]);
            numbers.extend(field.lattice().origin().to_array());
        }
        let window = self.window.lattice();
        for place in [pair.pivot(), window.origin()] {
            numbers.extend(place.to_array());
        }
        numbers.extend(window.shape().map(|n| n as f64));
        for q in self.rotations {
            numbers.extend(q.to_array());
        }
        let mut hash = blake3::Hasher::new();
        for number in numbers {
            hash.update(&number.to_le_bytes());
        }
        hash.update(pair.fixed().recipe.mesh.as_bytes());
        hash.update(pair.moving().recipe.mesh.as_bytes());
        hash.finalize().to_hex().to_string()
    }

    fn lattice_poses(&self, scan: &Scan, candidates: &[Candidate]) -> Vec<FoundPose> {
        let pose = |c: &Candidate| FoundPose {
            pose: scan.pose(self.rotations, c),
            energy: c.energy,
            refined: false,
            half_width: c.half_width,
            overlap: 0.0,
            rotation: c.rotation,
            lattice_energy: c.energy,
        };
        let poses: Vec<_> = candidates.iter().map(pose).collect();
        let apart = (0.7 * self.domain.step, 2.0 * scan.pair.spacing());
        self.distinct(&poses, apart, self.options.coarse_poses)
    }

    /// At most `count` poses farther apart than an angle (radians) and a distance, in order.
    fn distinct(&self, poses: &[FoundPose], apart: (f64, f64), count: usize) -> Vec<FoundPose> {
        let spacing = PoseSpacing {
            angle: apart.0,
            distance: apart.1,
            pivot: self.pivot,
            symmetries: self.domain.symmetries.clone(),
        };
        let kept = spacing.distinct(poses.iter().map(|p| &p.pose), count);
        kept.into_iter().map(|i| poses[i]).collect()
    }

    /// Sends every pose downhill on the sources of `pair`'s lattice in turn; the `count` lowest
    /// distinct ones, ranked by the last source.
    fn descend(
        &self,
        mut poses: Vec<FoundPose>,
        pair: &Pair,
        sources: &[&DirectEvaluator],
        count: usize,
    ) -> Vec<FoundPose> {
        let h = pair.spacing();
        let descent = Descent {
            pivot: self.pivot,
            radius: self.radius,
            first_step: h,
            last_step: 5e-3 * h,
            max_steps: 60,
        };
        poses.par_iter_mut().for_each(|p| {
            if self.monitor.cancelled() {
                p.refined = false;
                return;
            }
            let (mut pose, mut energy) = (p.pose, p.energy);
            for source in sources {
                (pose, energy) = descent.run(*source, &pose);
            }
            // Downhill may lead out of the domain: then the pose at its edge stays.
            p.refined = covers(self.window, pair.displacement(&pose));
            if p.refined {
                (p.pose, p.energy) = (pose, energy);
            }
            self.monitor.advance(1);
        });
        sort(&mut poses);
        self.distinct(&poses, (SAME_ANGLE, 2.0 * h), count)
    }

    /// Width and overlap of the poses that are returned.
    fn finish(
        &self,
        poses: Vec<FoundPose>,
        pair: &Pair,
        source: &DirectEvaluator,
    ) -> Vec<FoundPose> {
        let apart = (2.0 * SAME_ANGLE, 0.1 * self.radius);
        let mut poses = self.distinct(&poses, apart, self.options.top);
        poses.par_iter_mut().for_each(|p| {
            let scratch = &mut source.scratch();
            p.half_width = measure::half_width(source, scratch, &p.pose, p.energy, self.radius);
            p.overlap = measure::overlap(pair, &p.pose);
        });
        poses
    }
}

/// Poses that descended to within this angle and two cells of each other count as one, radians.
const SAME_ANGLE: f64 = 0.07;

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
