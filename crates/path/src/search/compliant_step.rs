//! Compliant motion: steps in one direction, each projected to contact, for as long as they lead on.

use fft_correlate::Pose;

use crate::collision::checker::{Allowed, Contact};
use crate::motion::vec6::{Vec6, dot, length, scaled};
use crate::search::directions::compliant_direction;
use crate::search::space::SearchSpace;

/// Less progress than this share of a step counts as stuck.
const STUCK: f64 = 0.3;
/// With less than this a shorter step is not tried.
const BLOCKED: f64 = 0.05;
/// Steps that stray from what was wanted by less than this share may become longer, up to
/// [`FASTEST`] times.
const SMOOTH: f64 = 0.15;
const FASTEST: f64 = 3.0;
/// Steps between two checks whether the part has been there.
const LOOK: usize = 5;
/// Poses over which the direction of a slide is taken.
const MEMORY: usize = 8;
/// Steps are halved this often before a slide counts as stuck.
const HALVINGS: u32 = 4;

/// When a compliant motion ends, besides at a wall and outside.
pub(crate) struct StopConditions<'a> {
    /// Greatest length, metres.
    pub(crate) longest: f64,
    /// Whether the part has been where a pose puts it.
    pub(crate) known: &'a (dyn Fn(&Pose) -> bool + Sync),
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

/// A step that succeeded.
struct Step {
    pose: Pose,
    motion: Vec6,
    /// Intermediate poses of a long step, a step apart.
    between: Vec<Pose>,
    /// Whether the walls left it almost as it was wanted.
    smooth: bool,
}

/// The result of a compliant motion.
#[derive(Debug, Clone, Default)]
pub(crate) struct CompliantPath {
    /// Poses after each step, without the first.
    pub(crate) poses: Vec<Pose>,
    /// The motion of the last step.
    pub(crate) last: Option<Vec6>,
    /// Whether the last pose is beside the fixed part.
    pub(crate) outside: bool,
    /// Poses at which collisions were checked.
    pub(crate) poses_checked: usize,
}

impl SearchSpace<'_> {
    /// Steps from `start` along `direction`, a motion of any length, until a stop condition holds. Each
    /// step is projected to contact; the next one repeats the motion of the last few, as a body without
    /// friction would.
    pub(crate) fn follow(
        &self,
        start: &Pose,
        direction: &Vec6,
        until: &StopConditions<'_>,
    ) -> CompliantPath {
        let mut contacts = Vec::new();
        let mut slide = CompliantPath::default();
        let frame = &self.checker.frame;
        let (mut at, mut along, mut gone, mut pace) = (*start, *direction, 0.0, 1.0);
        let within = 3.0 * self.limits.tolerance;
        let (filter, checker) = (self.duplicates, self.checker);
        if filter.is_symmetric_motion(checker, start, direction, within) {
            return slide;
        }
        let mut look = LOOK;
        while gone < until.longest && !(until.stop)() {
            let Some(step) =
                self.compliant_step(&at, &along, pace, &mut contacts, &mut slide.poses_checked)
            else {
                break;
            };
            gone += frame.largest(&at, &step.motion);
            // Longer steps where the walls do not divert the part.
            pace = if step.smooth {
                (1.5 * pace).min(FASTEST)
            } else {
                1.0
            };
            at = step.pose;
            slide.poses.extend(step.between);
            slide.poses.push(at);
            // The next step repeats the motion of the last few.
            along = self.recent_motion(start, &slide.poses);
            slide.last = Some(along);
            if self.exit(&at).distance < 0.0 {
                slide.outside = true;
                break;
            }
            // Stop where the part has been; checked now and then.
            if slide.poses.len() > look {
                look += LOOK;
                if (until.known)(&at) {
                    break;
                }
            }
        }
        slide
    }

    /// The screw motion through the last few poses, at the last one.
    fn recent_motion(&self, start: &Pose, poses: &[Pose]) -> Vec6 {
        let frame = &self.checker.frame;
        let now = poses.last().unwrap_or(start);
        let before = match poses.len() > MEMORY {
            true => &poses[poses.len() - 1 - MEMORY],
            false => start,
        };
        let motion = frame.between(before, now);
        let [from, to] = [before, now].map(|p| p.apply(frame.centre));
        frame.carried(&motion, from, to)
    }

    /// A step along a motion; if it fails, along the part of it that the walls resist little.
    fn compliant_step(
        &self,
        at: &Pose,
        along: &Vec6,
        pace: f64,
        contacts: &mut Vec<Contact>,
        poses_checked: &mut usize,
    ) -> Option<Step> {
        self.shortened_step(at, along, pace, contacts, poses_checked)
            .or_else(|| {
                let soft =
                    compliant_direction(self.checker, at, self.limits.level, along, contacts)?;
                self.shortened_step(at, &soft, 1.0, contacts, poses_checked)
            })
    }

    /// A step along a motion, shorter where it has to be.
    fn shortened_step(
        &self,
        at: &Pose,
        along: &Vec6,
        pace: f64,
        contacts: &mut Vec<Contact>,
        poses_checked: &mut usize,
    ) -> Option<Step> {
        let frame = &self.checker.frame;
        let full = scaled(along, self.step / frame.largest(at, along));
        let slower = (0..=HALVINGS).map(|halving| 0.5f64.powi(halving as i32));
        let fast = (pace > 1.0).then_some(pace);
        for share in fast.into_iter().chain(slower) {
            *poses_checked += 1;
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

    /// Projects the end of a motion to contact; else the share of the motion that was left, 1 if it led
    /// through something. `share` is the length of the motion in steps.
    fn trial(
        &self,
        at: &Pose,
        wanted: &Vec6,
        share: f64,
        contacts: &mut Vec<Contact>,
    ) -> Result<Step, f64> {
        let (checker, limits) = (self.checker, &self.limits);
        let reach = share.min(1.0) * self.step;
        let trial = checker.frame.moved(at, wanted);
        let pose = checker
            .project_to_contact(&trial, limits, reach, Allowed::All, contacts)
            .ok_or(1.0)?;
        let motion = checker.frame.between(at, &pose);
        let progress = dot(&motion, wanted) / dot(wanted, wanted);
        if progress < STUCK {
            return Err(progress);
        }
        if length(&motion) > 2.0 * length(wanted) {
            return Err(1.0);
        }
        let pieces = share.ceil() as usize;
        let piece = |i: usize| {
            checker
                .frame
                .moved(at, &scaled(&motion, i as f64 / pieces as f64))
        };
        let between: Vec<Pose> = (1..pieces).map(piece).collect();
        let depth = limits.depth(reach);
        if !between
            .iter()
            .all(|p| checker.is_free(p, limits.level, depth))
        {
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
