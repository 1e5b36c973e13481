//! The search for an insertion path: from two parts and a goal to a result.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use fft_correlate::{EnergySource, Pose, Response};
use rayon::prelude::*;
use sdf_grid::{Monitor, TriangleMesh};

use crate::collision::body::Body;
use crate::collision::checker::{CollisionChecker, ContactLimits};
use crate::error::PathError;
use crate::motion::describe::describe_motions;
use crate::penetration_levels::{LevelResult, PenetrationLevels};
use crate::request::{PathRequest, Start};
use crate::result::{
    Effort, EnergyBarrier, OtherPath, Outcome, PathPose, PathResult, energy_barrier,
};
use crate::search::exit::{ExitDistance, ExitPath, leave, round_outside};
use crate::search::inscribed_sphere::InscribedSphere;
use crate::search::space::SearchSpace;
use crate::search::visited::{DuplicateFilter, VisitedPoses};
use crate::smooth::equal_steps;

/// Points along sharp edges lie this many to the radius apart.
pub(crate) const POINTS: f64 = 40.0;
/// Steps of the search per radius.
const STEPS: f64 = 30.0;
/// Default tolerance, of the radius.
pub(crate) const TOLERANCE: f64 = 1e-3;
/// Units of progress that a search reports.
const PERCENT: u64 = 100;
/// An exit path ends when the parts' extents are this share of the radius apart.
const ROOM: f64 = 0.5;

/// A search for insertion paths between two parts.
///
/// See the example of [`PathRequest`].
pub struct PathSearch {
    checker: CollisionChecker,
    exits: ExitDistance,
    duplicates: DuplicateFilter,
    sphere: Option<InscribedSphere>,
    request: PathRequest,
}

/// The result of a search for an exit path alone.
pub(crate) struct ExitSearch {
    /// From where it is modelled to the outside.
    pub(crate) path: Option<PathResult>,
    /// Whether everything was tried.
    pub(crate) exhausted: bool,
    pub(crate) poses_checked: usize,
}

/// Reports the share of the exit distance that has been gained to a monitor.
struct ExitProgress<'a> {
    monitor: &'a dyn Monitor,
    percent: AtomicU64,
}

impl<'a> ExitProgress<'a> {
    fn begin(stage: &str, monitor: &'a dyn Monitor) -> Self {
        monitor.begin(stage, PERCENT);
        Self {
            monitor,
            percent: AtomicU64::new(0),
        }
    }

    /// A share, 0 ..= 1.
    fn report(&self, share: f64) {
        let percent = (PERCENT as f64 * share.clamp(0.0, 1.0)) as u64;
        let before = self.percent.fetch_max(percent, Ordering::Relaxed);
        self.monitor.advance(percent.saturating_sub(before));
    }
}

impl PathSearch {
    /// Prepares two parts, each in its own frame.
    ///
    /// # Errors
    /// If an option is out of range.
    pub fn new(
        fixed: Arc<TriangleMesh>,
        moving: Arc<TriangleMesh>,
        request: PathRequest,
    ) -> Result<Self, PathError> {
        Self::between(Body::of_mesh(fixed), Body::of_mesh(moving), request)
    }

    /// Prepares two bodies in one frame or each in its own.
    ///
    /// # Errors
    /// If an option is out of range.
    pub(crate) fn between(
        fixed: Body,
        moving: Body,
        request: PathRequest,
    ) -> Result<Self, PathError> {
        request.validate()?;
        let radius = moving.radius_about(moving.centroid());
        let checker = CollisionChecker::new(fixed, moving, radius / POINTS);
        Ok(Self {
            exits: ExitDistance::new(&checker),
            duplicates: DuplicateFilter::new(&checker),
            sphere: InscribedSphere::new(&checker),
            checker,
            request,
        })
    }

    /// Overlaps up to this depth count as contact, metres.
    pub fn tolerance(&self) -> f64 {
        let given = self.request.tolerance;
        given.unwrap_or(TOLERANCE * self.checker.frame.radius)
    }

    /// Searches a path to `goal`, a pose of the shapes. Energies come from `source`, evaluated at poses of
    /// the shapes; without a source only the solids count.
    ///
    /// # Errors
    /// If a pose is not one, the parts overlap at the goal or start and that is not allowed, the goal is
    /// outside, the source fails, or the monitor cancels.
    pub fn find(
        &self,
        goal: &Pose,
        source: Option<&dyn EnergySource>,
        monitor: &dyn Monitor,
    ) -> Result<PathResult, PathError> {
        self.find_from(goal, source, &mut VisitedPoses::default(), monitor)
    }

    /// Continues an earlier search for the same path that ran out of time or was stopped. The poses that
    /// this search visits are added to `visited`, even if it is stopped.
    ///
    /// # Errors
    /// As [`Self::find`], and if what was visited belongs to another question.
    pub fn find_from(
        &self,
        goal: &Pose,
        source: Option<&dyn EnergySource>,
        visited: &mut VisitedPoses,
        monitor: &dyn Monitor,
    ) -> Result<PathResult, PathError> {
        let stop = || monitor.cancelled();
        let mut lowest = self.level_at("goal", goal)?;
        let exit = self.exits.exit(&self.checker, goal);
        if exit.distance < 0.0 {
            return Err(PathError::Outside {
                gap: -exit.distance,
            });
        }
        if let Start::Pose(start) = &self.request.start {
            lowest = lowest.max(self.level_at("start", start)?);
        }
        let progress = ExitProgress::begin("path out", monitor);
        let gained = |share: f64| progress.report(share);
        let began = Instant::now();
        let levels = self.levels(&stop, &gained);
        visited.check_request([&self.checker.fixed, &self.checker.moving], goal, lowest)?;
        let mut opened = levels.search_lowest(goal, lowest, visited);
        let mut outwards = self.exit_paths(&opened);
        if let (Start::Pose(start), Some(_)) = (&self.request.start, outwards.first()) {
            let there = self.join_start(&levels, start, &mut opened, &outwards[0]);
            outwards = there.into_iter().collect();
        }
        if monitor.cancelled() {
            return Err(PathError::Cancelled);
        }
        gained(1.0);
        let search_seconds = began.elapsed().as_secs_f64();
        monitor.begin("straightening", 1);
        let began = Instant::now();
        let failed = || source.is_some_and(EnergySource::has_failed);
        let ended = || stop() || failed();
        let mut result = self.result(goal, &opened, &outwards, source, &ended);
        result.effort = self.effort(&opened, search_seconds, began);
        monitor.advance(1);
        match (monitor.cancelled(), failed()) {
            (true, _) => Err(PathError::Cancelled),
            (false, true) => Err(PathError::Energies),
            (false, false) => Ok(result),
        }
    }

    /// Searches an exit path from where the bodies are modelled, with no deeper overlap than there; a
    /// monitor gets its progress under the name `stage`.
    ///
    /// # Errors
    /// If they overlap there and that is not allowed, or the monitor cancels.
    pub(crate) fn search_exit(
        &self,
        stage: &str,
        monitor: &dyn Monitor,
    ) -> Result<ExitSearch, PathError> {
        let stop = || monitor.cancelled();
        let progress = ExitProgress::begin(stage, monitor);
        let gained = |share: f64| progress.report(share);
        let lowest = self.level_at("goal", &Pose::IDENTITY)?;
        let began = Instant::now();
        let levels = self.levels(&stop, &gained);
        let (opened, exhausted) =
            levels.search_level(&Pose::IDENTITY, lowest, &mut VisitedPoses::default());
        let search_seconds = began.elapsed().as_secs_f64();
        let outwards = self.exit_paths(&opened);
        let began = Instant::now();
        let path = outwards.first().map(|_| {
            let mut path = self.result(&Pose::IDENTITY, &opened, &outwards[..1], None, &stop);
            path.effort = self.effort(&opened, search_seconds, began);
            path.reversed()
        });
        match monitor.cancelled() {
            true => Err(PathError::Cancelled),
            false => Ok(ExitSearch {
                path,
                exhausted,
                poses_checked: opened.counts.poses_checked,
            }),
        }
    }

    fn effort(
        &self,
        opened: &LevelResult,
        search_seconds: f64,
        finishing_since: Instant,
    ) -> Effort {
        Effort {
            nodes: opened.counts.nodes,
            poses_checked: opened.counts.poses_checked,
            duplicates: opened.counts.duplicates,
            points: self.checker.point_count(),
            search_seconds,
            finish_seconds: finishing_since.elapsed().as_secs_f64(),
            step: self.step(),
        }
    }

    fn step(&self) -> f64 {
        self.checker.frame.radius / STEPS
    }

    /// The level that a pose needs: the tolerance, or what overlaps there if that is allowed.
    fn level_at(&self, which: &'static str, pose: &Pose) -> Result<f64, PathError> {
        if !pose.is_valid() {
            return Err(PathError::Pose { which });
        }
        let (depth, tolerance) = (
            self.checker.penetration_depth(pose, f64::INFINITY),
            self.tolerance(),
        );
        match depth <= tolerance {
            true => Ok(tolerance),
            false if self.request.allow_overlap => Ok(depth + tolerance),
            false => Err(PathError::Overlap {
                which,
                depth,
                volume: self.checker.interference_volume(pose),
                tolerance,
            }),
        }
    }

    fn levels<'a>(
        &'a self,
        stop: &'a (dyn Fn() -> bool + Sync),
        gained: &'a (dyn Fn(f64) + Sync),
    ) -> PenetrationLevels<'a> {
        PenetrationLevels {
            space: self.space(self.tolerance(), stop),
            sphere: self.sphere.as_ref(),
            time_limit: self.request.time_limit,
            others: self.request.others,
            gained,
        }
    }

    /// Overlaps up to `level` metres are allowed.
    fn space<'a>(&'a self, level: f64, stop: &'a (dyn Fn() -> bool + Sync)) -> SearchSpace<'a> {
        SearchSpace {
            checker: &self.checker,
            exits: &self.exits,
            duplicates: &self.duplicates,
            limits: ContactLimits {
                level,
                tolerance: self.tolerance(),
            },
            step: self.step(),
            stop,
        }
    }

    /// The paths out with their last, straight piece.
    fn exit_paths(&self, opened: &LevelResult) -> Vec<Vec<Pose>> {
        let room = ROOM * self.checker.frame.radius;
        let end = |w: &ExitPath| leave(&w.poses[w.poses.len() - 1], &w.exit, room);
        let paths = opened.paths.iter();
        paths.map(|w| [&w.poses[..], &[end(w)]].concat()).collect()
    }

    /// The exit path of the goal, joined round the outside to that of the start; none if the start has no
    /// exit path.
    fn join_start(
        &self,
        levels: &PenetrationLevels<'_>,
        start: &Pose,
        opened: &mut LevelResult,
        outwards: &[Pose],
    ) -> Option<Vec<Pose>> {
        let exit = self.exits.exit(&self.checker, start);
        let back = if exit.distance < 0.0 {
            vec![*start]
        } else {
            let other = levels.search_lowest(start, opened.level, &mut VisitedPoses::default());
            opened.counts.add(&other.counts);
            if other.outcome != Outcome::Free {
                opened.outcome = other.outcome;
                opened.level = other.level;
            }
            self.exit_paths(&other).into_iter().next()?
        };
        let (out, beyond) = (outwards[outwards.len() - 1], back[back.len() - 1]);
        let exits = [&out, &beyond].map(|p| self.exits.exit(&self.checker, p));
        let between = round_outside(&self.checker, (&out, &exits[0]), (&beyond, &exits[1]));
        let mut path = outwards.to_vec();
        path.extend(between);
        path.extend(back.iter().rev());
        Some(path)
    }

    fn result(
        &self,
        goal: &Pose,
        opened: &LevelResult,
        outwards: &[Vec<Pose>],
        source: Option<&dyn EnergySource>,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> PathResult {
        let step = self.request.step.unwrap_or(self.step());
        let process = PostProcessing {
            space: self.space(opened.level, stop),
            source,
        };
        let depth = source.map(|s| self.depth(s, goal));
        let processed = outwards.iter().map(|path| {
            let corners = process.shorten(path, self.request.start != Start::Outside);
            process.smooth(corners, step, depth)
        });
        let mut processed = lowest_first(processed.collect(), depth).into_iter();
        let first = processed.next();
        let others = processed.map(|f| self.other(f)).collect();
        let mut result = PathResult {
            outcome: opened.outcome,
            poses: Vec::new(),
            step,
            tolerance: self.tolerance(),
            barrier: None,
            depth,
            volume: 0.0,
            motions: Vec::new(),
            others,
            effort: Effort::default(),
        };
        if let Some(first) = first {
            result.motions = describe_motions(&self.checker.frame, &first.corners);
            result.barrier = first.barrier;
            result.poses = first.poses;
            result.step = self.largest_step(&result);
            result.volume = self.volume(&result);
        }
        result
    }

    /// Energy where the parts are out of each other's reach less that at the goal, joules.
    fn depth(&self, source: &dyn EnergySource, goal: &Pose) -> f64 {
        let size = |body: &Body| body.bounds().diagonal();
        let far = 100.0 * (size(&self.checker.fixed) + size(&self.checker.moving));
        let away = Pose {
            translation: goal.translation + far * glam::DVec3::Z,
            ..*goal
        };
        let mut scratch = source.scratch();
        let mut energy = |pose: &Pose| source.evaluate(pose, &mut scratch).energy;
        energy(&away) - energy(goal)
    }

    fn other(&self, finished: ProcessedPath) -> OtherPath {
        OtherPath {
            length: finished.poses.last().map_or(0.0, |p| p.length),
            motions: describe_motions(&self.checker.frame, &finished.corners),
            barrier: finished.barrier,
        }
    }

    fn largest_step(&self, result: &PathResult) -> f64 {
        let steps = result.poses.windows(2);
        let lengths = steps.map(|w| self.checker.frame.apart(&w[0].pose, &w[1].pose));
        lengths.fold(0.0, f64::max)
    }

    /// What the solids share where they overlap deepest.
    fn volume(&self, result: &PathResult) -> f64 {
        let (deepest, depth) = result.deepest();
        if depth <= 0.0 {
            return 0.0;
        }
        let pose = &result.poses[deepest].pose;
        self.checker.interference_volume(pose)
    }
}

/// Puts the path of least energy barrier first; the first one found stays if no other is lower by a
/// relevant share of the depth.
fn lowest_first(mut paths: Vec<ProcessedPath>, depth: Option<f64>) -> Vec<ProcessedPath> {
    let climb = |path: &ProcessedPath| path.barrier.map_or(0.0, |c| c.energy);
    let worth = RELEVANT_BARRIER * depth.unwrap_or(0.0).max(0.0);
    let least = (1..paths.len()).min_by(|a, b| climb(&paths[*a]).total_cmp(&climb(&paths[*b])));
    if let Some(least) = least.filter(|i| climb(&paths[*i]) + worth < climb(&paths[0])) {
        paths[..=least].rotate_right(1);
    }
    paths
}

/// Most poses of a result.
const MOST: usize = 2000;
/// Poses at which the energy is lowered.
const IMAGES: usize = 48;
/// A barrier of less than this share of the depth is not smoothed.
const RELEVANT_BARRIER: f64 = 0.01;
/// Overlaps are measured at points so many times as dense as those of the search.
const DENSER: f64 = 2.0;

/// Shortens, smooths and measures exit paths.
struct PostProcessing<'a> {
    space: SearchSpace<'a>,
    source: Option<&'a dyn EnergySource>,
}

/// A path, measured at each of its poses.
struct ProcessedPath {
    pub(crate) corners: Vec<Pose>,
    pub(crate) poses: Vec<PathPose>,
    pub(crate) barrier: Option<EnergyBarrier>,
}

impl PostProcessing<'_> {
    /// Shortens a path and reverses it: from the last pose of `outwards` to its first. Needless rotations
    /// are removed, too, unless the start is given.
    fn shorten(&self, outwards: &[Pose], keep_start: bool) -> Vec<Pose> {
        let space = &self.space;
        let inwards: Vec<Pose> = outwards.iter().rev().copied().collect();
        let short = match keep_start {
            true => space.shortcut(&inwards),
            false => match space.without_rotation(&inwards) {
                Some(path) => space.shortcut(&path),
                None => space.remove_rotations(&space.shortcut(&inwards)),
            },
        };
        space.reduce_vertices(short, keep_start)
    }

    /// The path along `corners` at equal steps, away from the walls, and with a lower energy barrier if it
    /// has one; `depth` is that of the fit, joules.
    fn smooth(&self, corners: Vec<Pose>, step: f64, depth: Option<f64>) -> ProcessedPath {
        let (checker, limits) = (self.space.checker, &self.space.limits);
        let frame = &checker.frame;
        let half = SearchSpace {
            step: 0.5 * self.space.step,
            ..self.space
        };
        // Equal steps, away from the walls.
        let poses = equal_steps(frame, &corners, step, MOST);
        let mut poses = half.away_from_walls(&poses);
        let mut responses = self.responses(&poses);
        let climb = |r: &[Response]| {
            let energies: Vec<f64> = r.iter().map(|r| r.energy).collect();
            depth.map(|d| energy_barrier(&energies, d))
        };
        let mut best = climb(&responses);
        // Lower the energy at fewer images, and keep the result if the barrier falls.
        if let (Some(source), Some(high)) =
            (self.source, best.filter(|c| c.share > RELEVANT_BARRIER))
        {
            let images = equal_steps(frame, &corners, self.space.step, IMAGES);
            let lowered = half.descend_energy(&half.away_from_walls(&images), source);
            let lowered = equal_steps(frame, &lowered, step, MOST);
            let lowered = half.away_from_walls(&lowered);
            let energies = self.responses(&lowered);
            let found = climb(&energies);
            let clear = |p: &Pose| checker.is_free(p, limits.level, 4.0 * self.space.step);
            if found.is_some_and(|f| f.energy < high.energy) && lowered.par_iter().all(clear) {
                (poses, responses, best) = (lowered, energies, found);
            }
        }
        ProcessedPath {
            poses: self.measure(&poses, &responses, step),
            barrier: best,
            corners,
        }
    }

    fn responses(&self, poses: &[Pose]) -> Vec<Response> {
        let Some(source) = self.source else {
            return Vec::new();
        };
        let at = |scratch: &mut _, pose: &Pose| source.evaluate(pose, scratch);
        let each = poses.par_iter().map_init(|| source.scratch(), at);
        each.collect()
    }

    /// Measures length and penetration depth at poses that lie `step` apart.
    fn measure(&self, poses: &[Pose], responses: &[Response], step: f64) -> Vec<PathPose> {
        let (checker, limits) = (self.space.checker, &self.space.limits);
        let frame = &checker.frame;
        let finer = checker.finer(frame.radius / POINTS / DENSER);
        // Poses a step of the search apart were clear of what is deeper than the level.
        let most = limits.depth(step.max(self.space.step));
        let depths: Vec<f64> = poses
            .par_iter()
            .map(|p| finer.penetration_depth(p, most))
            .collect();
        let mut length = 0.0;
        let mut measured = Vec::with_capacity(poses.len());
        for (i, pose) in poses.iter().enumerate() {
            if i > 0 {
                length += frame.largest(&poses[i - 1], &frame.between(&poses[i - 1], pose));
            }
            measured.push(PathPose {
                pose: *pose,
                length,
                depth: depths[i],
                response: responses.get(i).copied(),
            });
        }
        measured
    }
}
