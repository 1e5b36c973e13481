//! The search for a way in, from two parts to an answer.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use fft_correlate::{EnergySource, Pose};
use sdf_grid::{Monitor, TriangleMesh};

use crate::answer::{Effort, OtherPath, Outcome, PathAnswer};
use crate::contact::body::Body;
use crate::contact::gaps::Gaps;
use crate::contact::settle::Limits;
use crate::error::PathError;
use crate::motion::words::motions;
use crate::planner::finish::{Finish, Finished, WORTH};
use crate::planner::levels::{Levels, Opened};
use crate::planner::options::{PathOptions, Start};
use crate::search::cage::Cage;
use crate::search::escape::Escape;
use crate::search::explored::Explored;
use crate::search::grow::Way;
use crate::search::same::Shape;
use crate::way::connect::{leave, round_outside};

/// Points along sharp edges lie this many to the radius apart.
pub(crate) const POINTS: f64 = 40.0;
/// Steps of the search per radius.
const STEPS: f64 = 30.0;
/// Default tolerance, of the radius.
pub(crate) const TOLERANCE: f64 = 1e-3;
/// Units of progress that a search tells of.
const PERCENT: u64 = 100;
/// A way out ends when the parts' extents are this share of the radius apart.
const ROOM: f64 = 0.5;

/// Two parts between which ways are looked for.
pub struct PathSearch {
    gaps: Gaps,
    escape: Escape,
    shape: Shape,
    cage: Option<Cage>,
    options: PathOptions,
}

/// Whether a body comes out of another.
pub(crate) struct WayOut {
    /// From where it is modelled to the outside.
    pub(crate) way: Option<PathAnswer>,
    /// Whether everything was tried.
    pub(crate) exhausted: bool,
    pub(crate) looked: usize,
}

/// How much of the way out has been gained, told to a monitor.
struct Gained<'a> {
    monitor: &'a dyn Monitor,
    told: AtomicU64,
}

impl<'a> Gained<'a> {
    fn begin(stage: &str, monitor: &'a dyn Monitor) -> Self {
        monitor.begin(stage, PERCENT);
        Self {
            monitor,
            told: AtomicU64::new(0),
        }
    }

    /// A share, 0 ..= 1.
    fn tell(&self, share: f64) {
        let percent = (PERCENT as f64 * share.clamp(0.0, 1.0)) as u64;
        let before = self.told.fetch_max(percent, Ordering::Relaxed);
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
        options: PathOptions,
    ) -> Result<Self, PathError> {
        Self::between(Body::of_mesh(fixed), Body::of_mesh(moving), options)
    }

    /// Prepares two bodies in one frame or each in its own.
    ///
    /// # Errors
    /// If an option is out of range.
    pub(crate) fn between(
        fixed: Body,
        moving: Body,
        options: PathOptions,
    ) -> Result<Self, PathError> {
        options.validate()?;
        let radius = moving.radius_about(moving.centroid());
        let gaps = Gaps::new(fixed, moving, radius / POINTS);
        Ok(Self {
            escape: Escape::new(&gaps),
            shape: Shape::new(&gaps),
            cage: Cage::new(&gaps),
            gaps,
            options,
        })
    }

    /// Overlaps up to this depth count as contact, metres.
    pub fn tolerance(&self) -> f64 {
        let given = self.options.tolerance;
        given.unwrap_or(TOLERANCE * self.gaps.frame.radius)
    }

    /// The way to `goal`, a pose of the shapes. Energies come from `source`, asked at poses of the
    /// shapes; without one only the solids are looked at.
    ///
    /// # Errors
    /// If a pose is not one, the parts overlap at the goal or start and that is not allowed, the goal is
    /// outside, or the monitor cancels.
    pub fn find(
        &self,
        goal: &Pose,
        source: Option<&dyn EnergySource>,
        monitor: &dyn Monitor,
    ) -> Result<PathAnswer, PathError> {
        self.find_from(goal, source, &mut Explored::default(), monitor)
    }

    /// The same, going on from what an earlier search for the same way has explored before its time ran
    /// out or it was stopped; what this one explores is added, also if it is stopped.
    ///
    /// # Errors
    /// As [`Self::find`], and if what was explored belongs to another question.
    pub fn find_from(
        &self,
        goal: &Pose,
        source: Option<&dyn EnergySource>,
        explored: &mut Explored,
        monitor: &dyn Monitor,
    ) -> Result<PathAnswer, PathError> {
        let stop = || monitor.cancelled();
        let mut lowest = self.level_at("goal", goal)?;
        let exit = self.escape.exit(&self.gaps, goal);
        if exit.distance < 0.0 {
            return Err(PathError::Outside {
                gap: -exit.distance,
            });
        }
        if let Start::Pose(start) = &self.options.start {
            lowest = lowest.max(self.level_at("start", start)?);
        }
        let told = Gained::begin("way out", monitor);
        let gained = |share: f64| told.tell(share);
        let began = Instant::now();
        let levels = self.levels(&stop, &gained);
        explored.ask([&self.gaps.fixed, &self.gaps.moving], goal, lowest)?;
        let mut opened = levels.out_of(goal, lowest, explored);
        let mut outwards = self.left(&opened);
        if let (Start::Pose(start), Some(_)) = (&self.options.start, outwards.first()) {
            let there = self.joined(&levels, start, &mut opened, &outwards[0]);
            outwards = there.into_iter().collect();
        }
        if monitor.cancelled() {
            return Err(PathError::Cancelled);
        }
        gained(1.0);
        let search_seconds = began.elapsed().as_secs_f64();
        monitor.begin("straightening", 1);
        let began = Instant::now();
        let mut answer = self.answer(goal, &opened, &outwards, source, &stop);
        answer.effort = self.effort(&opened, search_seconds, began);
        monitor.advance(1);
        match monitor.cancelled() {
            true => Err(PathError::Cancelled),
            false => Ok(answer),
        }
    }

    /// The way out of where the bodies are modelled, for which they overlap no deeper than there; a
    /// monitor hears of it under the name `stage`.
    ///
    /// # Errors
    /// If they overlap there and that is not allowed, or the monitor cancels.
    pub(crate) fn out(&self, stage: &str, monitor: &dyn Monitor) -> Result<WayOut, PathError> {
        let stop = || monitor.cancelled();
        let told = Gained::begin(stage, monitor);
        let gained = |share: f64| told.tell(share);
        let lowest = self.level_at("goal", &Pose::IDENTITY)?;
        let began = Instant::now();
        let levels = self.levels(&stop, &gained);
        let (opened, exhausted) = levels.out_at(&Pose::IDENTITY, lowest, &mut Explored::default());
        let search_seconds = began.elapsed().as_secs_f64();
        let outwards = self.left(&opened);
        let began = Instant::now();
        let way = outwards.first().map(|_| {
            let mut way = self.answer(&Pose::IDENTITY, &opened, &outwards[..1], None, &stop);
            way.effort = self.effort(&opened, search_seconds, began);
            way.outwards()
        });
        match monitor.cancelled() {
            true => Err(PathError::Cancelled),
            false => Ok(WayOut {
                way,
                exhausted,
                looked: opened.looked,
            }),
        }
    }

    fn effort(&self, opened: &Opened, search_seconds: f64, finishing_since: Instant) -> Effort {
        Effort {
            nodes: opened.nodes,
            looked: opened.looked,
            passed_over: opened.passed_over,
            points: self.gaps.points(),
            search_seconds,
            finish_seconds: finishing_since.elapsed().as_secs_f64(),
            step: self.step(),
        }
    }

    fn step(&self) -> f64 {
        self.gaps.frame.radius / STEPS
    }

    /// The level that a pose needs: the tolerance, or what overlaps there if that is allowed.
    fn level_at(&self, which: &'static str, pose: &Pose) -> Result<f64, PathError> {
        if !pose.is_valid() {
            return Err(PathError::Pose { which });
        }
        let (depth, tolerance) = (self.gaps.depth(pose, f64::INFINITY), self.tolerance());
        match depth <= tolerance {
            true => Ok(tolerance),
            false if self.options.allow_overlap => Ok(depth + tolerance),
            false => Err(PathError::Overlap {
                which,
                depth,
                volume: self.gaps.shared_volume(pose),
                tolerance,
            }),
        }
    }

    fn levels<'a>(
        &'a self,
        stop: &'a (dyn Fn() -> bool + Sync),
        gained: &'a (dyn Fn(f64) + Sync),
    ) -> Levels<'a> {
        Levels {
            gaps: &self.gaps,
            escape: &self.escape,
            shape: &self.shape,
            cage: self.cage.as_ref(),
            tolerance: self.tolerance(),
            step: self.step(),
            time_limit: self.options.time_limit,
            others: self.options.others,
            stop,
            gained,
        }
    }

    /// The ways out with their last, straight piece.
    fn left(&self, opened: &Opened) -> Vec<Vec<Pose>> {
        let room = ROOM * self.gaps.frame.radius;
        let end = |w: &Way| leave(&w.poses[w.poses.len() - 1], &w.exit, room);
        let ways = opened.ways.iter();
        ways.map(|w| [&w.poses[..], &[end(w)]].concat()).collect()
    }

    /// The way out of the goal, round the outside, and back along the way out of the start; none if the
    /// start has none.
    fn joined(
        &self,
        levels: &Levels<'_>,
        start: &Pose,
        opened: &mut Opened,
        outwards: &[Pose],
    ) -> Option<Vec<Pose>> {
        let exit = self.escape.exit(&self.gaps, start);
        let back = if exit.distance < 0.0 {
            vec![*start]
        } else {
            let other = levels.out_of(start, opened.level, &mut Explored::default());
            opened.nodes += other.nodes;
            opened.looked += other.looked;
            opened.passed_over += other.passed_over;
            if other.outcome != Outcome::Free {
                opened.outcome = other.outcome;
                opened.level = other.level;
            }
            self.left(&other).into_iter().next()?
        };
        let (out, beyond) = (outwards[outwards.len() - 1], back[back.len() - 1]);
        let exits = [&out, &beyond].map(|p| self.escape.exit(&self.gaps, p));
        let between = round_outside(&self.gaps, (&out, &exits[0]), (&beyond, &exits[1]));
        let mut way = outwards.to_vec();
        way.extend(between);
        way.extend(back.iter().rev());
        Some(way)
    }

    fn answer(
        &self,
        goal: &Pose,
        opened: &Opened,
        outwards: &[Vec<Pose>],
        source: Option<&dyn EnergySource>,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> PathAnswer {
        let step = self.options.step.unwrap_or(self.step());
        let finish = Finish {
            gaps: &self.gaps,
            escape: &self.escape,
            limits: Limits {
                level: opened.level,
                tolerance: self.tolerance(),
            },
            step: self.step(),
            spacing: self.gaps.frame.radius / POINTS,
            source,
            stop,
        };
        let depth = source.map(|s| self.depth(s, goal));
        let finished = outwards.iter().map(|way| {
            let corners = finish.straightened(way, self.options.start != Start::Outside);
            finish.finished(corners, step, depth)
        });
        let mut finished = lowest_first(finished.collect(), depth).into_iter();
        let first = finished.next();
        let others = finished.map(|f| self.other(f)).collect();
        let mut answer = PathAnswer {
            outcome: opened.outcome,
            poses: Vec::new(),
            step,
            tolerance: self.tolerance(),
            climb: None,
            depth,
            volume: 0.0,
            motions: Vec::new(),
            others,
            effort: Effort::default(),
        };
        if let Some(first) = first {
            answer.motions = motions(&self.gaps.frame, &first.corners);
            answer.climb = first.climb;
            answer.poses = first.poses;
            answer.step = self.largest_step(&answer);
            answer.volume = self.volume(&answer);
        }
        answer
    }

    /// Energy where the parts are out of each other's reach less that at the goal, joules.
    fn depth(&self, source: &dyn EnergySource, goal: &Pose) -> f64 {
        let size = |body: &Body| body.bounds().diagonal();
        let far = 100.0 * (size(&self.gaps.fixed) + size(&self.gaps.moving));
        let away = Pose {
            translation: goal.translation + far * glam::DVec3::Z,
            ..*goal
        };
        let mut scratch = source.scratch();
        let mut energy = |pose: &Pose| source.evaluate(pose, &mut scratch).energy;
        energy(&away) - energy(goal)
    }

    fn other(&self, finished: Finished) -> OtherPath {
        OtherPath {
            length: finished.poses.last().map_or(0.0, |p| p.length),
            motions: motions(&self.gaps.frame, &finished.corners),
            climb: finished.climb,
        }
    }

    fn largest_step(&self, answer: &PathAnswer) -> f64 {
        let steps = answer.poses.windows(2);
        let lengths = steps.map(|w| self.gaps.frame.apart(&w[0].pose, &w[1].pose));
        lengths.fold(0.0, f64::max)
    }

    /// What the solids share where they overlap deepest.
    fn volume(&self, answer: &PathAnswer) -> f64 {
        let (deepest, depth) = answer.deepest();
        if depth <= 0.0 {
            return 0.0;
        }
        let pose = &answer.poses[deepest].pose;
        self.gaps.shared_volume(pose)
    }
}

/// Ways with the one of least climb first; the first one found stays if no other is lower by a share of
/// the depth that is worth it.
fn lowest_first(mut ways: Vec<Finished>, depth: Option<f64>) -> Vec<Finished> {
    let climb = |way: &Finished| way.climb.map_or(0.0, |c| c.energy);
    let worth = WORTH * depth.unwrap_or(0.0).max(0.0);
    let least = (1..ways.len()).min_by(|a, b| climb(&ways[*a]).total_cmp(&climb(&ways[*b])));
    if let Some(least) = least.filter(|i| climb(&ways[*i]) + worth < climb(&ways[0])) {
        ways[..=least].rotate_right(1);
    }
    ways
}
