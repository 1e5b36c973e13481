//! Leaving out what is not needed of a way.

use fft_correlate::Pose;
use glam::DQuat;
use rayon::prelude::*;

use crate::contact::gaps::Gaps;
use crate::contact::settle::{By, Limits};
use crate::search::escape::Escape;

/// Two poses are joined by the turn of least angle: up to this one, radians, it is the one meant.
const WIDEST_TURN: f64 = 2.9;

/// How many poses on a first shortcut is tried.
const FIRST_STRIDE: usize = 4;

/// How many steps a part that leaned is shifted at once to stand upright.
const LEANING: f64 = 2.0;

/// How many steps deeper than allowed overlaps are seen: neighbours are one apart.
const BEYOND: f64 = 1.5;

/// Poses that are looked at together.
const TOGETHER: usize = 16;

/// What straight and screw motions between poses must keep.
pub(crate) struct Shortcuts<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) limits: Limits,
    /// Poses are looked at this far apart, metres.
    pub(crate) step: f64,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

impl Shortcuts<'_> {
    /// The first and last pose, and of those between as few as lead from one to the next by screw
    /// motions within the limits, or nearly: up to an eighth of each motion is given away.
    pub(crate) fn shorten(&self, poses: &[Pose]) -> Vec<Pose> {
        let mut kept = vec![poses[0]];
        let (mut at, mut stride) = (0, FIRST_STRIDE);
        while at + 1 < poses.len() {
            let to = self.farthest(poses, at, stride);
            // A screw goes on about as far as it went.
            stride = (to - at).max(2);
            at = to;
            kept.push(poses[at]);
        }
        kept
    }

    /// The same way without any turn, if there is one: every pose as the last one is turned, where the
    /// part leaned shifted off what it overlaps so. Poses lie a step apart.
    pub(crate) fn translated(&self, poses: &[Pose]) -> Option<Vec<Pose>> {
        let (centre, last) = (self.gaps.frame.centre, poses[poses.len() - 1]);
        let rotation = last.rotation;
        let unturned = |pose: &Pose| {
            let pose = Pose::new(rotation, pose.apply(centre) - rotation * centre);
            if (self.stop)() {
                return None;
            }
            let (mut contacts, reach) = (Vec::new(), LEANING * self.step);
            self.gaps
                .settle(&pose, &self.limits, reach, By::Shifts, &mut contacts)
        };
        let mut way: Vec<Pose> = poses.par_iter().map(unturned).collect::<Option<_>>()?;
        *way.last_mut()? = last;
        way.par_windows(2)
            .all(|w| self.joins(&w[0], &w[1]))
            .then_some(way)
    }

    /// The same way with turns left out that nothing asks for, as those of a round peg about its axis:
    /// the last pose stays, those before it turn with what follows.
    pub(crate) fn unturned(&self, poses: &[Pose]) -> Vec<Pose> {
        let frame = &self.gaps.frame;
        let mut outwards: Vec<Pose> = poses.iter().rev().copied().collect();
        for i in 1..outwards.len() {
            let turn = outwards[i].rotation.conjugate() * outwards[i - 1].rotation;
            if turn.angle_between(DQuat::IDENTITY) < 1e-9 || (self.stop)() {
                continue;
            }
            let about_centre = |pose: &Pose| {
                let rotation = pose.rotation * turn;
                Pose::new(rotation, pose.apply(frame.centre) - rotation * frame.centre)
            };
            let turned: Vec<Pose> = outwards[i..].iter().map(about_centre).collect();
            let joined = |k: usize| {
                let before = if k == 0 {
                    &outwards[i - 1]
                } else {
                    &turned[k - 1]
                };
                self.joins(before, &turned[k])
            };
            if (0..turned.len()).all(joined) {
                outwards.truncate(i);
                outwards.extend(turned);
            }
        }
        outwards.reverse();
        outwards
    }

    /// A pose far on that can be reached directly: from `stride` poses on by doubling as long as it goes,
    /// or by halving until it does, then between the last that went and the first that did not.
    fn farthest(&self, poses: &[Pose], from: usize, stride: usize) -> usize {
        let last = poses.len() - 1;
        let reached = |to: usize| self.joins(&poses[from], &poses[to]);
        let (mut good, mut bad, mut stride) = (from + 1, last + 1, stride);
        while good < last && !(self.stop)() {
            let to = (from + stride).min(last);
            if to > good && reached(to) {
                good = to;
                if bad <= last {
                    break;
                }
                stride *= 2;
            } else {
                bad = to.max(good + 1);
                if good > from + 1 || stride <= 2 {
                    break;
                }
                stride = (stride / 2).max(2);
            }
        }
        // What is left to gain is not worth as many looks as have been.
        while bad - good > 1 + (good - from) / 8 && bad <= last && !(self.stop)() {
            let middle = (good + bad) / 2;
            if reached(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        good
    }

    /// Whether the screw motion between two poses stays within the limits.
    pub(crate) fn joins(&self, from: &Pose, to: &Pose) -> bool {
        let frame = &self.gaps.frame;
        let motion = frame.between(from, to);
        if frame.turn(&motion).length() > WIDEST_TURN {
            return false;
        }
        let count = (frame.largest(from, &motion) / self.step).ceil().max(1.0);
        let level = self.limits.level;
        // What is no deeper than the level at one pose is no deeper than a step beyond it at the next.
        let depth = level + BEYOND * self.step;
        let clear = |i: &usize| {
            let pose = frame.interpolated(from, to, *i as f64 / count);
            self.gaps.clear(&pose, level, depth)
        };
        let places: Vec<usize> = scattered(count as usize).collect();
        places
            .chunks(TOGETHER)
            .all(|some| some.par_iter().all(clear))
    }
}

/// The numbers between 0 and `count`, both left out, such that each is far from those before it: what
/// is in the way is soon met.
fn scattered(count: usize) -> impl Iterator<Item = usize> {
    let bits = usize::BITS - count.leading_zeros();
    let reversed = move |i: usize| i.reverse_bits() >> (usize::BITS - bits);
    (1..1usize << bits)
        .map(reversed)
        .filter(move |i| *i < count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::Body;
    use glam::DVec3;
    use pegfit_fixtures as shapes;
    use std::sync::Arc;

    const LIMITS: Limits = Limits {
        level: 2e-5,
        tolerance: 2e-5,
    };

    #[test]
    fn scattered_numbers_are_all_of_them() {
        for count in [1, 2, 3, 7, 8, 100] {
            let mut all: Vec<usize> = scattered(count).collect();
            all.sort_unstable();
            assert_eq!(all, (1..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn turns_about_the_axis_of_a_round_peg_are_left_out() {
        let (hole, peg) = shapes::PegInHole::Circular.pair(1e-4).unwrap();
        let gaps = Gaps::new(
            Body::of_mesh(Arc::new(hole)),
            Body::of_mesh(Arc::new(peg)),
            5e-4,
        );
        let at = |i: i32| {
            let share = f64::from(i);
            Pose::new(DQuat::from_rotation_z(0.4 * share), DVec3::Z * 0.01 * share)
        };
        let shortcuts = Shortcuts {
            gaps: &gaps,
            escape: &Escape::new(&gaps),
            limits: LIMITS,
            step: 5e-4,
            stop: &|| false,
        };
        let way: Vec<Pose> = [4, 3, 0].map(at).to_vec();
        for (pose, before) in shortcuts.unturned(&way).iter().zip(&way) {
            assert!(pose.rotation.angle_between(DQuat::IDENTITY) < 1e-7);
            assert!((pose.translation - before.translation).length() < 1e-9);
        }
    }

    /// Where the spool leaned it would stand a tenth of a millimetre in the wall.
    #[test]
    fn a_part_that_leaned_in_its_play_is_shifted_upright() {
        let (plate, spool) = shapes::spool_in_slot(2e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_x(-1.1), DVec3::new(0.04, 0.0, -0.02));
        let plate = plate.transformed(place.rotation, place.translation);
        let gaps = Gaps::new(
            Body::of_mesh(Arc::new(plate)),
            Body::of_mesh(Arc::new(spool)),
            2e-4,
        );
        let at = |i: i32, lean: f64| {
            let (x, turn) = (-2e-4 * f64::from(i), DQuat::from_rotation_y(0.05 * lean));
            place * Pose::new(turn, DVec3::new(x, 0.0, 3e-4 * lean))
        };
        let leaning: Vec<Pose> = (0..20).rev().map(|i| at(i, f64::from(i.min(1)))).collect();
        let shortcuts = Shortcuts {
            gaps: &gaps,
            escape: &Escape::new(&gaps),
            limits: LIMITS,
            step: 3e-4,
            stop: &|| false,
        };
        assert!(!gaps.clear(&at(9, 1.0), LIMITS.level, 1e-3));
        let way = shortcuts.translated(&leaning).unwrap();
        assert_eq!(way[19], leaning[19]);
        for pose in &way {
            assert!(pose.angle_to(&way[19]) < 1e-6 && gaps.clear(pose, LIMITS.level, 1e-3));
        }
        let wall = place * Pose::from_translation(DVec3::new(0.0, 4e-3, 0.0));
        assert_eq!(shortcuts.translated(&[&[wall], &way[18..]].concat()), None);
    }

    #[test]
    fn a_way_round_a_corner_keeps_its_corner() {
        let (plate, spool) = shapes::spool_in_slot(2e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_y(0.8), DVec3::splat(0.02));
        let plate = plate.transformed(place.rotation, place.translation);
        let gaps = Gaps::new(
            Body::of_mesh(Arc::new(plate)),
            Body::of_mesh(Arc::new(spool)),
            2e-4,
        );
        let at = |x: f64, y: f64| place * Pose::from_translation(1e-3 * DVec3::new(x, y, 0.0));
        let mut poses: Vec<Pose> = (0..=16).map(|i| at(-0.5 * f64::from(i), 0.0)).collect();
        poses.extend((1..=24).map(|i| at(-8.0, -0.5 * f64::from(i))));
        let shortcuts = Shortcuts {
            gaps: &gaps,
            escape: &Escape::new(&gaps),
            limits: LIMITS,
            step: 2e-4,
            stop: &|| false,
        };
        let short = shortcuts.shorten(&poses);
        assert!((3..=4).contains(&short.len()), "{}", short.len());
        assert_eq!((short[0], short[short.len() - 1]), (poses[0], poses[40]));
        let corner = at(-8.0, 0.0);
        assert!(short.iter().any(|p| gaps.frame.apart(p, &corner) < 6e-4));
    }
}
