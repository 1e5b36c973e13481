//! Sliding on in one direction for as long as it goes.

use fft_correlate::Pose;

use crate::contact::gaps::{Contact, Gaps};
use crate::contact::settle::Limits;
use crate::motion::six::{Vec6, dot, length, scaled};
use crate::search::escape::Escape;
use crate::search::same::Shape;

/// Less progress than this share of a step counts as stuck.
const STUCK: f64 = 0.3;
/// With less than this a shorter step is not tried.
const BLOCKED: f64 = 0.05;
/// Steps are halved this often before a slide counts as stuck.
const HALVINGS: u32 = 4;
/// After this share of the radius a motion that changes nothing is given up.
const NOTHING_CHANGED: f64 = 0.7;

/// What all slides of a search share.
#[derive(Debug)]
pub(crate) struct Slides<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) shape: &'a Shape,
    pub(crate) limits: Limits,
    /// Largest motion of any point in one step, metres.
    pub(crate) step: f64,
    /// Longest slide, metres.
    pub(crate) longest: f64,
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
    /// Goes on from `start` along `direction`: after each step the part is pushed out of what it
    /// overlaps, and the next step repeats the motion that resulted, as a body without friction would.
    pub(crate) fn slide(
        &self,
        start: &Pose,
        direction: &Vec6,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Slide {
        let mut contacts = Vec::new();
        let mut slide = Slide::default();
        let (mut at, mut along) = (*start, *direction);
        let mut gone = 0.0;
        let mut doubtful = true;
        while gone < self.longest && !stop() {
            let Some((next, motion)) = self.step(&at, &along, &mut contacts, &mut slide.looked)
            else {
                break;
            };
            gone += self.gaps.frame.largest(&at, &motion);
            let centre = self.gaps.frame.centre;
            along = self
                .gaps
                .frame
                .carried(&motion, at.apply(centre), next.apply(centre));
            at = next;
            slide.poses.push(at);
            slide.last = Some(along);
            if self.escape.exit(self.gaps, &at).distance < 0.0 {
                slide.outside = true;
                break;
            }
            if doubtful && gone > NOTHING_CHANGED * self.gaps.frame.radius {
                doubtful = false;
                let little = 3.0 * self.limits.tolerance;
                if self.shape.same(self.gaps, start, &at, little) {
                    return Slide {
                        looked: slide.looked,
                        ..Slide::default()
                    };
                }
            }
        }
        slide
    }

    /// A step along a motion, shorter where it has to be; the pose it leads to and the motion there.
    fn step(
        &self,
        at: &Pose,
        along: &Vec6,
        contacts: &mut Vec<Contact>,
        looked: &mut usize,
    ) -> Option<(Pose, Vec6)> {
        let frame = &self.gaps.frame;
        let full = scaled(along, self.step / frame.largest(at, along));
        for halving in 0..=HALVINGS {
            let share = 0.5f64.powi(halving as i32);
            let wanted = scaled(&full, share);
            *looked += 1;
            match self.trial(at, &wanted, share * self.step, contacts) {
                Ok(found) => return Some(found),
                // Shorter steps go no better against a wall.
                Err(progress) if progress < BLOCKED => return None,
                Err(_) => {}
            }
        }
        None
    }

    /// The pose next to where a motion leads, and the motion there; else the share of the motion that
    /// was left, one if it led through something.
    fn trial(
        &self,
        at: &Pose,
        wanted: &Vec6,
        reach: f64,
        contacts: &mut Vec<Contact>,
    ) -> Result<(Pose, Vec6), f64> {
        let (gaps, limits) = (self.gaps, &self.limits);
        let trial = gaps.frame.moved(at, wanted);
        let next = gaps.settle(&trial, limits, reach, contacts).ok_or(1.0)?;
        let motion = gaps.frame.between(at, &next);
        let progress = dot(&motion, wanted) / dot(wanted, wanted);
        if progress < STUCK {
            return Err(progress);
        }
        let middle = gaps.frame.moved(at, &scaled(&motion, 0.5));
        let through = !gaps.clear(&middle, limits.level, limits.depth(reach));
        match through || length(&motion) > 2.0 * length(wanted) {
            true => Err(1.0),
            false => Ok((next, motion)),
        }
    }
}
