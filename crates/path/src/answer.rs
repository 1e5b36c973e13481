//! What is found of a way in.

use fft_correlate::{Pose, Response};

use crate::motion::words::Motion;
use crate::way::climb::Climb;

/// A way from outside (or a given pose) to the goal, and all that is told of it. Poses and motions are
/// of the shapes, in the fixed part's own frame.
#[derive(Debug, Clone)]
pub struct PathAnswer {
    /// Whether the way is free.
    pub outcome: Outcome,
    /// From the start to the goal, at equal steps; empty if nothing was found at any level.
    pub poses: Vec<PathPose>,
    /// Largest motion of any point of the part from one pose to the next, metres.
    pub step: f64,
    /// Overlaps up to this depth count as contact, metres.
    pub tolerance: f64,
    /// The highest climb, if energies were asked for.
    pub climb: Option<Climb>,
    /// Energy out of reach less that of the goal, joules, if energies were asked for.
    pub depth: Option<f64>,
    /// Largest volume that the solids share along the way, cubic metres: looked at where they overlap
    /// deepest.
    pub volume: f64,
    /// The way in words, short motions left out.
    pub motions: Vec<Motion>,
    /// Other ways that leave in other directions, looked for as long as the first one took; none of
    /// them climbs less, by more than a hundredth of the depth.
    pub others: Vec<OtherPath>,
    /// What was looked at.
    pub effort: Effort,
}

/// Whether a part gets there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// At the points of the search the solids never overlap by more than the tolerance; whether denser
    /// ones agree says [`PathAnswer::is_free`].
    Free,
    /// They have to overlap; the way given is that of least overlap.
    Blocked {
        /// With overlaps up to this depth a way was found, metres; none if at no depth tried.
        passed_at: Option<f64>,
        /// With overlaps up to this depth none was found, metres.
        stuck_at: f64,
        /// Whether everything was tried at the tolerance (at the step of the search), or it is proven
        /// that there is no way; else time ran out.
        exhausted: bool,
        /// Whether it is proven, whatever the part does: a ball inside of it does not come out with
        /// overlaps up to the tolerance.
        proven: bool,
    },
}

/// A pose along a way.
#[derive(Debug, Clone, Copy)]
pub struct PathPose {
    /// Of the shapes.
    pub pose: Pose,
    /// Way of the farthest-going point since the start, metres.
    pub length: f64,
    /// By how much the deepest point of either part lies in the other, metres.
    pub depth: f64,
    /// Energy and wrench on the part, if they were asked for.
    pub response: Option<Response>,
}

/// Another way.
#[derive(Debug, Clone)]
pub struct OtherPath {
    /// Way of the farthest-going point, metres.
    pub length: f64,
    /// The way in words, inwards.
    pub motions: Vec<Motion>,
    /// The highest climb along it, if energies were asked for.
    pub climb: Option<Climb>,
}

/// What a search has looked at.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Effort {
    /// Poses from which ways on were tried.
    pub nodes: usize,
    /// Poses to which the part was pushed.
    pub looked: usize,
    /// Places that were come to again and not gone on from: the part had been there.
    pub passed_over: usize,
    /// Points of both surfaces that distances were taken at.
    pub points: usize,
    /// Of the search, seconds.
    pub search_seconds: f64,
    /// Of what came after: shortening, relaxing, measuring; seconds.
    pub finish_seconds: f64,
    /// Longest motion of any point between two poses of the search, metres.
    pub step: f64,
}

impl PathAnswer {
    /// The largest overlap along the way, metres, and at which pose.
    pub fn deepest(&self) -> (usize, f64) {
        let depths = self.poses.iter().map(|p| p.depth).enumerate();
        let deepest = depths.max_by(|a, b| a.1.total_cmp(&b.1));
        deepest.unwrap_or((0, 0.0))
    }

    /// Whether a way was found and no overlap measured along it is deeper than the tolerance.
    pub fn is_free(&self) -> bool {
        self.outcome == Outcome::Free && self.deepest().1 <= self.tolerance
    }

    /// How much the part turns in all, radians.
    pub fn turn(&self) -> f64 {
        let steps = self.poses.windows(2);
        steps.map(|w| w[0].pose.angle_to(&w[1].pose)).sum()
    }

    /// The same way from the goal to the start; without energies and other ways.
    pub(crate) fn outwards(mut self) -> Self {
        let whole = self.length();
        self.poses.reverse();
        for pose in &mut self.poses {
            pose.length = whole - pose.length;
        }
        self.motions = self.motions.iter().rev().map(Motion::reversed).collect();
        self
    }

    /// Way of the farthest-going point, metres.
    pub fn length(&self) -> f64 {
        self.poses.last().map_or(0.0, |p| p.length)
    }
}
