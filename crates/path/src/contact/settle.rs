//! The nearest pose at which the parts do not overlap.

use fft_correlate::Pose;

use crate::contact::gaps::{Contact, Gaps};
use crate::motion::six::{Mat6, Vec6, add_product, length, scaled, solve_damped};

/// Most corrections of a pose.
const MOST: usize = 8;

/// Two corrections that gain less than this share of what is missing show that no more will.
const STALLED: f64 = 0.1;

/// How far corrections may lead.
struct Within {
    /// From here,
    origin: Pose,
    /// so many times three, metres; no farther at once than this.
    reach: f64,
    by: By,
}

/// By which motions a pose is corrected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum By {
    /// Turns and shifts.
    Any,
    /// Shifts alone.
    Shifts,
}

/// How much overlap counts as none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    /// Overlaps no deeper than this are allowed, metres.
    pub(crate) level: f64,
    /// How finely distances are told apart, metres: parts are kept three times this above the level
    /// where there is room.
    pub(crate) tolerance: f64,
}

impl Limits {
    /// Down to which distance contacts are looked for, metres, for motions of at most `step`.
    pub(crate) fn depth(&self, step: f64) -> f64 {
        self.level + 2.0 * step + self.tolerance
    }
}

impl Gaps {
    /// The pose within the limits next to `pose`, by corrections that are together at most `reach`
    /// long, metres; none if there is none.
    ///
    /// Each correction is the smallest motion that opens all gaps that are too narrow as far as
    /// possible (least squares over the contacts that are).
    pub(crate) fn settle(
        &self,
        pose: &Pose,
        limits: &Limits,
        reach: f64,
        by: By,
        contacts: &mut Vec<Contact>,
    ) -> Option<Pose> {
        let within = Within {
            origin: *pose,
            reach,
            by,
        };
        // Room on all sides if there is; where it is almost too narrow, none.
        let aim = |room: f64| room * limits.tolerance - limits.level;
        match self.opened(pose, limits, aim(3.0), &within, contacts) {
            Ok(found) => Some(found),
            Err((least, _)) if least < aim(-4.0) => None,
            Err((_, best)) => {
                let found = self.opened(&best, limits, aim(1.0), &within, contacts);
                found.ok()
            }
        }
    }

    /// The pose next to `pose` with distances of `aim`, or at least within the limits; else the least
    /// distance that was come to, and where.
    fn opened(
        &self,
        pose: &Pose,
        limits: &Limits,
        aim: f64,
        within: &Within,
        contacts: &mut Vec<Contact>,
    ) -> Result<Pose, (f64, Pose)> {
        let depth = limits.depth(within.reach);
        let (mut at, mut best, mut stalls) = (*pose, (f64::NEG_INFINITY, *pose), 0);
        for _ in 0..MOST {
            let least = self.near(&at, aim, depth, contacts);
            let (gain, done) = (least - best.0, best.0 >= -limits.level);
            let missing = -limits.level - best.0;
            if gain > 0.0 {
                best = (least, at);
            }
            let enough = least >= aim - 0.25 * limits.tolerance;
            if enough || (done && gain < 0.2 * limits.tolerance) {
                break;
            }
            // Where two walls push against each other nothing is gained.
            stalls = if gain < STALLED * missing {
                stalls + 1
            } else {
                0
            };
            if stalls > 1 {
                break;
            }
            let Some(correction) = opening(contacts, aim, within.by) else {
                break;
            };
            let size = length(&correction);
            let correction = scaled(&correction, (within.reach / size).min(1.0));
            at = self.frame.moved(&at, &correction);
            if self.frame.apart(&within.origin, &at) > 3.0 * within.reach {
                break;
            }
        }
        match best.0 >= -limits.level {
            true => Ok(best.1),
            false => Err(best),
        }
    }
}

/// The smallest motion that brings all distances below `aim` to it, in the mean square.
fn opening(contacts: &[Contact], aim: f64, by: By) -> Option<Vec6> {
    let mut stiffness: Mat6 = [[0.0; 6]; 6];
    let mut pull: Vec6 = [0.0; 6];
    for c in contacts.iter().filter(|c| c.distance < aim) {
        let mut slope = c.slope;
        if by == By::Shifts {
            slope[..3].fill(0.0);
        }
        add_product(&mut stiffness, &slope, 1.0);
        for (p, s) in pull.iter_mut().zip(&slope) {
            *p += (aim - c.distance) * s;
        }
    }
    solve_damped(stiffness, pull).filter(|x| length(x) > 0.0)
}
