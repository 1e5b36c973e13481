//! Sliding on in one direction for as long as it goes.

use fft_correlate::Pose;

use crate::contact::gaps::{Contact, Gaps};
use crate::contact::settle::{By, Limits};
use crate::motion::six::{Vec6, dot, length, scaled};
use crate::search::directions::softened;
use crate::search::escape::Escape;
use crate::search::same::Shape;

/// Less progress than this share of a step counts as stuck.
const STUCK: f64 = 0.3;
/// With less than this a shorter step is not tried.
const BLOCKED: f64 = 0.05;
/// Steps that stray from what was wanted by less than this share may become longer, up to
/// [`FASTEST`] times.
const SMOOTH: f64 = 0.15;
const FASTEST: f64 = 3.0;
/// A slide looks after so many steps each whether it has come where the part has been.
const LOOK: usize = 5;
/// Poses over which the direction of a slide is taken.
const MEMORY: usize = 8;
/// Steps are halved this often before a slide counts as stuck.
const HALVINGS: u32 = 4;

/// What all slides of a search share.
#[derive(Debug)]
pub(crate) struct Slides<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) shape: &'a Shape,
    pub(crate) limits: Limits,
    /// Largest motion of any point in one step, metres.
    pub(crate) step: f64,
}

/// What ends a slide besides a wall and the outside.
pub(crate) struct Until<'a> {
    /// Length of a slide, metres.
    pub(crate) longest: f64,
    /// Whether the part has been where a pose puts it.
    pub(crate) known: &'a (dyn Fn(&Pose) -> bool + Sync),
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

/// A step that went.
struct Step {
    pose: Pose,
    motion: Vec6,
    /// Poses on the way, a step apart, if it was longer than that.
    between: Vec<Pose>,
    /// Whether the walls left it almost as it was wanted.
    smooth: bool,
}

/// Where a slide has led.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slide {
    /// Poses after each step, without the first.
    pub(crate) poses: Vec<Pose>,
    /// The motion of the last step.
    pub(crate) last: Option<Vec6>,
    /// Whether the last pose is beside the fixed part.
    pub(crate) outside: bool,
    /// Poses that were looked at.
    pub(crate) looked: usize,
}

impl Slides<'_> {
    /// Goes on from `start` along `direction` until one of the reasons to end: after each step the part is
    /// pushed out of what it overlaps, and the next step repeats the motion of the last few, as a body
    /// without friction would.
    pub(crate) fn slide(&self, start: &Pose, direction: &Vec6, until: &Until<'_>) -> Slide {
        let mut contacts = Vec::new();
        let mut slide = Slide::default();
        let frame = &self.gaps.frame;
        let (mut at, mut along, mut gone, mut pace) = (*start, *direction, 0.0, 1.0);
        let within = 3.0 * self.limits.tolerance;
        if self
            .shape
            .turns_in_itself(self.gaps, start, direction, within)
        {
            return slide;
        }
        let mut look = LOOK;
        while gone < until.longest && !(until.stop)() {
            let Some(step) = self.step(&at, &along, pace, &mut contacts, &mut slide.looked) else {
                break;
            };
            gone += frame.largest(&at, &step.motion);
            pace = if step.smooth {
                (1.5 * pace).min(FASTEST)
            } else {
                1.0
            };
            at = step.pose;
            slide.poses.extend(step.between);
            slide.poses.push(at);
            along = self.momentum(start, &slide.poses);
            slide.last = Some(along);
            if self.escape.exit(self.gaps, &at).distance < 0.0 {
                slide.outside = true;
                break;
            }
            if slide.poses.len() > look {
                look += LOOK;
                if (until.known)(&at) {
                    break;
                }
            }
        }
        slide
    }

    /// The screw that has led through the last few poses, where it has led to.
    fn momentum(&self, start: &Pose, poses: &[Pose]) -> Vec6 {
        let frame = &self.gaps.frame;
        let now = poses.last().unwrap_or(start);
        let before = match poses.len() > MEMORY {
            true => &poses[poses.len() - 1 - MEMORY],
            false => start,
        };
        let motion = frame.between(before, now);
        let [from, to] = [before, now].map(|p| p.apply(frame.centre));
        frame.carried(&motion, from, to)
    }

    /// A step along a motion; if it does not go, along what the walls leave of the motion.
    fn step(
        &self,
        at: &Pose,
        along: &Vec6,
        pace: f64,
        contacts: &mut Vec<Contact>,
        looked: &mut usize,
    ) -> Option<Step> {
        self.straight(at, along, pace, contacts, looked)
            .or_else(|| {
                let soft = softened(self.gaps, at, self.limits.level, along, contacts)?;
                self.straight(at, &soft, 1.0, contacts, looked)
            })
    }

    /// A step along a motion, shorter where it has to be.
    fn straight(
        &self,
        at: &Pose,
        along: &Vec6,
        pace: f64,
        contacts: &mut Vec<Contact>,
        looked: &mut usize,
    ) -> Option<Step> {
        let frame = &self.gaps.frame;
        let full = scaled(along, self.step / frame.largest(at, along));
        let slower = (0..=HALVINGS).map(|halving| 0.5f64.powi(halving as i32));
        let fast = (pace > 1.0).then_some(pace);
        for share in fast.into_iter().chain(slower) {
            *looked += 1;
            let wanted = scaled(&full, share);
            match self.trial(at, &wanted, share, contacts) {
                Ok(step) => return Some(step),
                // Shorter steps go no better against a wall.
                Err(progress) if progress < BLOCKED && share <= 1.0 => return None,
                Err(_) => {}
            }
        }
        None
    }

    /// The pose next to where a motion leads; else the share of the motion that was left, one if it led
    /// through something. `share` is the motion's, of a step.
    fn trial(
        &self,
        at: &Pose,
        wanted: &Vec6,
        share: f64,
        contacts: &mut Vec<Contact>,
    ) -> Result<Step, f64> {
        let (gaps, limits) = (self.gaps, &self.limits);
        let reach = share.min(1.0) * self.step;
        let trial = gaps.frame.moved(at, wanted);
        let pose = gaps
            .settle(&trial, limits, reach, By::Any, contacts)
            .ok_or(1.0)?;
        let motion = gaps.frame.between(at, &pose);
        let progress = dot(&motion, wanted) / dot(wanted, wanted);
        if progress < STUCK {
            return Err(progress);
        }
        if length(&motion) > 2.0 * length(wanted) {
            return Err(1.0);
        }
        let pieces = share.ceil() as usize;
        let piece = |i: usize| {
            gaps.frame
                .moved(at, &scaled(&motion, i as f64 / pieces as f64))
        };
        let between: Vec<Pose> = (1..pieces).map(piece).collect();
        let depth = limits.depth(reach);
        if !between.iter().all(|p| gaps.clear(p, limits.level, depth)) {
            return Err(1.0);
        }
        let astray: Vec6 = std::array::from_fn(|k| motion[k] - wanted[k]);
        let smooth = length(&astray) < SMOOTH * length(wanted);
        Ok(Step {
            pose,
            motion,
            between,
            smooth,
        })
    }
}
