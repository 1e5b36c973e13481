//! Raises the allowed penetration level by level until an exit path exists.

use std::time::{Duration, Instant};

use fft_correlate::Pose;

use crate::result::Outcome;
use crate::search::exit::ExitPath;
use crate::search::expand::{Expansion, ExpansionResult, SearchCounts};
use crate::search::inscribed_sphere::InscribedSphere;
use crate::search::single_motion::SingleMotion;
use crate::search::space::SearchSpace;
use crate::search::visited::VisitedPoses;

/// Each level is so many times as high as the last.
const RISE: f64 = 4.0;
/// The highest level, as a share of the radius.
const HIGHEST: f64 = 0.5;
/// Halvings (in proportion) between the last level that failed and the first that did not.
const HALVINGS: usize = 2;
/// Poses closer than so many steps count as duplicates, coarsely first: with much play there are many
/// poses.
const WITHIN: [f64; 3] = [4.0, 2.0, 1.0];
/// Share of the time in which paths of a single motion are searched: one in so many.
const SINGLE: u32 = 4;

/// What the searches at all levels share.
pub(crate) struct PenetrationLevels<'a> {
    /// Its level is replaced by that of each search.
    pub(crate) space: SearchSpace<'a>,
    /// What may prove that there is no path.
    pub(crate) sphere: Option<&'a InscribedSphere>,
    pub(crate) time_limit: Duration,
    pub(crate) others: f64,
    /// Hears which share of the exit distance has been gained, 0 ..= 1.
    pub(crate) gained: &'a (dyn Fn(f64) + Sync),
}

/// Exit paths from a pose, and the level at which they were found.
pub(crate) struct LevelResult {
    pub(crate) outcome: Outcome,
    pub(crate) level: f64,
    pub(crate) paths: Vec<ExitPath>,
    pub(crate) counts: SearchCounts,
}

impl LevelResult {
    fn new(level: f64, expanded: ExpansionResult) -> Self {
        Self {
            outcome: Outcome::Free,
            level,
            paths: expanded.paths,
            counts: expanded.counts,
        }
    }
}

impl PenetrationLevels<'_> {
    /// Exit paths from a pose at one level, and whether there are no others: proven, or the search is
    /// exhausted. Continues from the visited poses.
    pub(crate) fn search_level(
        &self,
        pose: &Pose,
        level: f64,
        visited: &mut VisitedPoses,
    ) -> (LevelResult, bool) {
        let expanded = match self.lower_bound(pose, level) > level {
            true => ExpansionResult::exhausted(),
            false => self.search_new(pose, level, visited),
        };
        let exhausted = expanded.exhausted;
        (LevelResult::new(level, expanded), exhausted)
    }

    /// Penetration up to which it is proven that no path leads out from a pose, metres; the level if
    /// nothing is proven.
    fn lower_bound(&self, pose: &Pose, level: f64) -> f64 {
        let bound = |s: &InscribedSphere| s.lower_bound(self.space.checker, pose, level);
        self.sphere.map_or(level, bound)
    }

    /// Single motions first, if the search is new, then the expansion.
    fn search_new(&self, pose: &Pose, level: f64, visited: &mut VisitedPoses) -> ExpansionResult {
        let began = Instant::now();
        let single = SingleMotion {
            space: self.space.at_level(level),
            deadline: began + self.time_limit / SINGLE,
        };
        let found = match visited.is_new() {
            true => single.paths(pose, self.others > 0.0),
            false => Vec::new(),
        };
        self.expand(pose, level, (began, self.time_limit), found, visited)
    }

    /// Exit paths from a pose at the lowest level at which one is found, `lowest` being the first; that
    /// one continues from the visited poses.
    pub(crate) fn search_lowest(
        &self,
        pose: &Pose,
        lowest: f64,
        visited: &mut VisitedPoses,
    ) -> LevelResult {
        let began = Instant::now();
        let highest = HIGHEST * self.space.checker.frame.radius;
        let stopped = || (self.space.stop)();
        let bound = self.lower_bound(pose, lowest);
        let proven = bound > lowest;
        let expanded = match proven {
            true => ExpansionResult::exhausted(),
            false => self.search_new(pose, lowest, visited),
        };
        let exhausted = expanded.exhausted;
        let mut result = LevelResult::new(lowest, expanded);
        if !result.paths.is_empty() || stopped() {
            return result;
        }
        // Raise the level until a path exists; the higher levels take as long again in all.
        let share = self.time_limit.max(began.elapsed()) / 8;
        let (mut stuck, mut passed) = (bound, None);
        let mut level = lowest;
        while passed.is_none() && level < highest && !stopped() {
            level = (RISE * level).min(highest);
            if level <= bound {
                continue;
            }
            match self.try_level(pose, level, share, &mut result) {
                true => passed = Some(level),
                false => stuck = level,
            }
        }
        // Bisect between the last level that failed and the one that did not.
        for _ in 0..HALVINGS {
            let Some(above) = passed.filter(|_| !stopped()) else {
                break;
            };
            let level = (stuck * above).sqrt();
            match self.try_level(pose, level, share, &mut result) {
                true => passed = Some(level),
                false => stuck = level,
            }
        }
        result.outcome = Outcome::Blocked {
            passed_at: passed,
            stuck_at: stuck,
            exhausted,
            proven,
        };
        result
    }

    /// Whether a path exists at a level; it replaces the paths found before.
    fn try_level(
        &self,
        pose: &Pose,
        level: f64,
        limit: Duration,
        result: &mut LevelResult,
    ) -> bool {
        let time = (Instant::now(), limit);
        let expanded = self.expand(pose, level, time, Vec::new(), &mut VisitedPoses::default());
        result.counts.add(&expanded.counts);
        let found = !expanded.paths.is_empty();
        if found {
            result.paths = expanded.paths;
            result.level = level;
        }
        tracing::debug!(level, found, expanded.counts.nodes, "penetration allowed");
        found
    }

    /// Expands pass after pass, from coarse to fine, `found` being known already.
    fn expand(
        &self,
        pose: &Pose,
        level: f64,
        (began, limit): (Instant, Duration),
        mut found: Vec<ExitPath>,
        visited: &mut VisitedPoses,
    ) -> ExpansionResult {
        let mut all = ExpansionResult::exhausted();
        for within in WITHIN.into_iter().skip(visited.passes) {
            let expansion = Expansion {
                space: self.space.at_level(level),
                within: within * self.space.step,
                began,
                deadline: began + limit,
                others: self.others,
                gained: self.gained,
            };
            let pass = expansion.run(pose, std::mem::take(&mut found), &mut visited.nodes);
            tracing::debug!(within, pass.counts.nodes, pass.exhausted, "expanded");
            all.counts.add(&pass.counts);
            all.paths = pass.paths;
            all.exhausted = pass.exhausted;
            if !all.paths.is_empty() || !all.exhausted {
                break;
            }
            visited.passes += 1;
            visited.nodes.clear();
        }
        all
    }
}
