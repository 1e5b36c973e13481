//! From ways found step by step to an answer.

use fft_correlate::{EnergySource, Pose, Response};
use rayon::prelude::*;

use crate::answer::PathPose;
use crate::contact::gaps::Gaps;
use crate::contact::settle::Limits;
use crate::search::escape::Escape;
use crate::way::climb::{Climb, highest_climb};
use crate::way::relax::Relaxation;
use crate::way::shorten::Shortcuts;
use crate::way::steps::equal_steps;

/// Most poses of an answer.
const MOST: usize = 2000;
/// Poses that the energy is relaxed at.
const IMAGES: usize = 48;
/// A climb of less than this share of the depth is not worth relaxing.
pub(crate) const WORTH: f64 = 0.01;
/// Overlaps are measured at points so many times as dense as those of the search.
const DENSER: f64 = 2.0;

/// What ways are finished in.
pub(crate) struct Finish<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) limits: Limits,
    /// Of the search, metres.
    pub(crate) step: f64,
    /// Of the points along sharp edges that it looks at, metres.
    pub(crate) spacing: f64,
    pub(crate) source: Option<&'a dyn EnergySource>,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

/// A way with what is told of each of its poses.
pub(crate) struct Finished {
    pub(crate) corners: Vec<Pose>,
    pub(crate) poses: Vec<PathPose>,
    pub(crate) climb: Option<Climb>,
}

impl Finish<'_> {
    /// A way without detours, inwards: from the last pose of `outwards` to its first. Turns that nothing
    /// asks for go, too, unless the way begins where it was asked to.
    pub(crate) fn straightened(&self, outwards: &[Pose], keep_start: bool) -> Vec<Pose> {
        let shortcuts = Shortcuts {
            gaps: self.gaps,
            escape: self.escape,
            limits: self.limits,
            step: self.step,
            stop: self.stop,
        };
        let inwards: Vec<Pose> = outwards.iter().rev().copied().collect();
        let short = match keep_start {
            true => shortcuts.shorten(&inwards),
            false => match shortcuts.translated(&inwards) {
                Some(way) => shortcuts.shorten(&way),
                None => shortcuts.unturned(&shortcuts.shorten(&inwards)),
            },
        };
        shortcuts.fewer(short, keep_start)
    }

    /// The way between `corners` at equal steps, off the walls, and lower if it climbs; `depth` is that
    /// of the fit, joules.
    pub(crate) fn finished(&self, corners: Vec<Pose>, step: f64, depth: Option<f64>) -> Finished {
        let relaxation = Relaxation {
            gaps: self.gaps,
            limits: self.limits,
            step: 0.5 * self.step,
            stop: self.stop,
        };
        let frame = &self.gaps.frame;
        let (poses, _) = equal_steps(frame, &corners, step, MOST);
        let mut poses = relaxation.off_walls(&poses);
        let mut responses = self.responses(&poses);
        let climb = |r: &[Response]| {
            let energies: Vec<f64> = r.iter().map(|r| r.energy).collect();
            depth.map(|d| highest_climb(&energies, d))
        };
        let mut best = climb(&responses);
        if let (Some(source), Some(high)) = (self.source, best.filter(|c| c.share > WORTH)) {
            let (images, _) = equal_steps(frame, &corners, self.step, IMAGES);
            let lowered = relaxation.down(&relaxation.off_walls(&images), source);
            let (lowered, _) = equal_steps(frame, &lowered, step, MOST);
            let lowered = relaxation.off_walls(&lowered);
            let energies = self.responses(&lowered);
            let found = climb(&energies);
            let clear = |p: &Pose| self.gaps.clear(p, self.limits.level, 4.0 * self.step);
            if found.is_some_and(|f| f.energy < high.energy) && lowered.par_iter().all(clear) {
                (poses, responses, best) = (lowered, energies, found);
            }
        }
        Finished {
            poses: self.told(&poses, &responses, step),
            climb: best,
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

    /// Poses `step` apart with their depths.
    fn told(&self, poses: &[Pose], responses: &[Response], step: f64) -> Vec<PathPose> {
        let frame = &self.gaps.frame;
        let finer = self.gaps.finer(self.spacing / DENSER);
        // Poses a step of the search apart were clear of what is deeper than the level.
        let most = self.limits.depth(step.max(self.step));
        let depths: Vec<f64> = poses.par_iter().map(|p| finer.depth(p, most)).collect();
        let mut length = 0.0;
        let mut told = Vec::with_capacity(poses.len());
        for (i, pose) in poses.iter().enumerate() {
            if i > 0 {
                length += frame.largest(&poses[i - 1], &frame.between(&poses[i - 1], pose));
            }
            told.push(PathPose {
                pose: *pose,
                length,
                depth: depths[i],
                response: responses.get(i).copied(),
            });
        }
        told
    }
}
