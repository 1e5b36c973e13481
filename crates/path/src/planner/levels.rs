//! Raising the overlap that is allowed until a way opens.

use std::time::{Duration, Instant};

use fft_correlate::Pose;

use crate::answer::Outcome;
use crate::contact::gaps::Gaps;
use crate::contact::settle::Limits;
use crate::search::cage::Cage;
use crate::search::escape::Escape;
use crate::search::explored::Explored;
use crate::search::grow::{Grown, Growth, Way};
use crate::search::same::Shape;
use crate::search::single::Single;

/// Each level is so many times as high as the last.
const RISE: f64 = 4.0;
/// The highest level, as a share of the radius.
const HIGHEST: f64 = 0.5;
/// Halvings (in proportion) between the last level that failed and the first that did not.
const HALVINGS: usize = 2;

/// Places so many steps apart count as one, coarsely first: where there is much play there are many
/// places.
const WITHIN: [f64; 3] = [4.0, 2.0, 1.0];

/// Ways of one motion are looked for in this part of the time.
const SINGLE: u32 = 4;

/// What searches at all levels share.
pub(crate) struct Levels<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) shape: &'a Shape,
    /// What may prove that there is no way.
    pub(crate) cage: Option<&'a Cage>,
    pub(crate) tolerance: f64,
    pub(crate) step: f64,
    pub(crate) time_limit: Duration,
    pub(crate) others: f64,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
    /// Hears how much of the way out has been gained, 0 ..= 1.
    pub(crate) gained: &'a (dyn Fn(f64) + Sync),
}

/// Ways out of a pose, and at which level they opened.
pub(crate) struct Opened {
    pub(crate) outcome: Outcome,
    pub(crate) level: f64,
    pub(crate) ways: Vec<Way>,
    pub(crate) nodes: usize,
    pub(crate) looked: usize,
    pub(crate) passed_over: usize,
}

/// What one search keeps to.
struct Within {
    level: f64,
    began: Instant,
    deadline: Instant,
}

impl Opened {
    fn nothing(level: f64) -> Self {
        Self {
            outcome: Outcome::Free,
            level,
            ways: Vec::new(),
            nodes: 0,
            looked: 0,
            passed_over: 0,
        }
    }
}

impl Levels<'_> {
    /// Ways from a pose to the outside at one level, and whether there are no others: proven, or
    /// everything was tried; goes on from what has been explored.
    pub(crate) fn out_at(
        &self,
        pose: &Pose,
        level: f64,
        explored: &mut Explored,
    ) -> (Opened, bool) {
        match self.held(pose, level) > level {
            true => (Opened::nothing(level), true),
            false => self.searched(pose, level, explored),
        }
    }

    /// Depth up to which it is proven that nothing comes out from a pose, metres; the level if it is
    /// not.
    fn held(&self, pose: &Pose, level: f64) -> f64 {
        let held = |cage: &Cage| cage.least_overlap(self.gaps, pose, level);
        self.cage.map_or(level, held)
    }

    fn searched(&self, pose: &Pose, level: f64, explored: &mut Explored) -> (Opened, bool) {
        let began = Instant::now();
        let within = Within {
            level,
            began,
            deadline: began + self.time_limit,
        };
        let found = match explored.is_new() {
            true => self.single(pose, level, began + self.time_limit / SINGLE),
            false => Vec::new(),
        };
        let (grown, nodes) = self.at(pose, &within, found, explored);
        let opened = Opened {
            nodes,
            looked: grown.looked,
            passed_over: grown.passed_over,
            ways: grown.ways,
            ..Opened::nothing(level)
        };
        (opened, grown.exhausted)
    }

    /// Ways from a pose to the outside at the lowest level at which one is found, `lowest` being the
    /// first one tried; that one goes on from what has been explored.
    pub(crate) fn out_of(&self, pose: &Pose, lowest: f64, explored: &mut Explored) -> Opened {
        let began = Instant::now();
        let held = self.held(pose, lowest);
        let proven = held > lowest;
        let (mut opened, exhausted) = match proven {
            true => (Opened::nothing(lowest), true),
            false => self.searched(pose, lowest, explored),
        };
        if !opened.ways.is_empty() || (self.stop)() {
            return opened;
        }
        // As long again in all for what would have to give way.
        let share = self.time_limit.max(began.elapsed()) / 8;
        let (mut stuck, mut passed) = (held, None);
        let mut level = lowest;
        while passed.is_none() && level < HIGHEST * self.gaps.frame.radius && !(self.stop)() {
            level = (RISE * level).min(HIGHEST * self.gaps.frame.radius);
            if level <= held {
                continue;
            }
            match self.tried(pose, level, share, &mut opened) {
                true => passed = Some(level),
                false => stuck = level,
            }
        }
        for _ in 0..HALVINGS {
            let Some(above) = passed.filter(|_| !(self.stop)()) else {
                break;
            };
            let level = (stuck * above).sqrt();
            match self.tried(pose, level, share, &mut opened) {
                true => passed = Some(level),
                false => stuck = level,
            }
        }
        opened.outcome = Outcome::Blocked {
            passed_at: passed,
            stuck_at: stuck,
            exhausted,
            proven,
        };
        opened
    }

    /// Whether a way is found at a level; it replaces the ways found before.
    fn tried(&self, pose: &Pose, level: f64, limit: Duration, opened: &mut Opened) -> bool {
        let began = Instant::now();
        let within = Within {
            level,
            began,
            deadline: began + limit,
        };
        let (grown, nodes) = self.at(pose, &within, Vec::new(), &mut Explored::default());
        opened.nodes += nodes;
        opened.looked += grown.looked;
        opened.passed_over += grown.passed_over;
        let found = !grown.ways.is_empty();
        if found {
            opened.ways = grown.ways;
            opened.level = level;
        }
        tracing::debug!(level, found, nodes, "overlap allowed");
        found
    }

    /// Ways of one motion.
    fn single(&self, pose: &Pose, level: f64, deadline: Instant) -> Vec<Way> {
        let single = Single {
            gaps: self.gaps,
            escape: self.escape,
            shape: self.shape,
            limits: self.limits(level),
            step: self.step,
            deadline,
            stop: self.stop,
        };
        single.ways(pose, self.others > 0.0)
    }

    fn limits(&self, level: f64) -> Limits {
        Limits {
            level,
            tolerance: self.tolerance,
        }
    }

    /// One pass after the other, `found` being known already; also how many nodes there are in all.
    fn at(
        &self,
        pose: &Pose,
        Within {
            level,
            began,
            deadline,
        }: &Within,
        mut found: Vec<Way>,
        explored: &mut Explored,
    ) -> (Grown, usize) {
        let mut all = Grown {
            exhausted: true,
            ..Grown::default()
        };
        let mut nodes = 0;
        for within in WITHIN.into_iter().skip(explored.passes) {
            let growth = Growth {
                gaps: self.gaps,
                escape: self.escape,
                shape: self.shape,
                limits: self.limits(*level),
                step: self.step,
                within: within * self.step,
                began: *began,
                deadline: *deadline,
                others: self.others,
                stop: self.stop,
                gained: self.gained,
            };
            let grown = growth.run(pose, std::mem::take(&mut found), &mut explored.nodes);
            let reached = explored.nodes.len();
            tracing::debug!(within, reached, grown.looked, grown.exhausted, "grown");
            nodes += reached;
            all.looked += grown.looked;
            all.passed_over += grown.passed_over;
            all.ways = grown.ways;
            all.exhausted = grown.exhausted;
            if !all.ways.is_empty() || !all.exhausted {
                break;
            }
            explored.passes += 1;
            explored.nodes.clear();
        }
        (all, nodes)
    }
}
