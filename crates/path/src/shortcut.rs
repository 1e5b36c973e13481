//! Shortcuts: fewer vertices of a path, and no rotations that nothing asks for.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::collision::checker::Allowed;
use crate::search::space::SearchSpace;

/// Two poses are joined by the turn of least angle: up to this one, radians, it is the one meant.
const WIDEST_TURN: f64 = 2.9;

/// How many poses on a first shortcut is tried.
const FIRST_STRIDE: usize = 4;

/// How many steps a part that leaned is shifted at once to stand upright.
const LEANING: f64 = 2.0;

/// How many steps deeper than allowed overlaps are seen: neighbours are one apart.
const BEYOND: f64 = 1.5;

/// Poses that are checked together.
const TOGETHER: usize = 16;

impl SearchSpace<'_> {
    /// The first and last pose, and of those between as few as lead from one to the next by screw
    /// motions within the limits, or nearly: up to an eighth of each motion is given away.
    pub(crate) fn shortcut(&self, poses: &[Pose]) -> Vec<Pose> {
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

    /// The same path without rotations, if there is one: every pose gets the rotation of the last one, and
    /// is translated to contact where the part leaned. Poses lie a step apart.
    pub(crate) fn without_rotation(&self, poses: &[Pose]) -> Option<Vec<Pose>> {
        let (centre, last) = (self.checker.frame.centre, poses[poses.len() - 1]);
        let rotation = last.rotation;
        let unturned = |pose: &Pose| {
            let pose = Pose::new(rotation, pose.apply(centre) - rotation * centre);
            if (self.stop)() {
                return None;
            }
            let (mut contacts, reach) = (Vec::new(), LEANING * self.step);
            self.checker.project_to_contact(
                &pose,
                &self.limits,
                reach,
                Allowed::Translations,
                &mut contacts,
            )
        };
        let mut path: Vec<Pose> = poses.par_iter().map(unturned).collect::<Option<_>>()?;
        *path.last_mut()? = last;
        path.par_windows(2)
            .all(|w| self.is_free_between(&w[0], &w[1]))
            .then_some(path)
    }

    /// Removes needless rotations, as those of a round peg about its axis:
    /// the last pose stays, those before it turn with what follows.
    pub(crate) fn remove_rotations(&self, poses: &[Pose]) -> Vec<Pose> {
        let frame = &self.checker.frame;
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
                self.is_free_between(before, &turned[k])
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
        let reached = |to: usize| self.is_free_between(&poses[from], &poses[to]);
        let (mut good, mut bad, mut stride) = (from + 1, last + 1, stride);
        // Double the stride while it succeeds, or halve it until it does.
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
        // Bisect between the last success and the first failure, until little is left to gain.
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
    pub(crate) fn is_free_between(&self, from: &Pose, to: &Pose) -> bool {
        let frame = &self.checker.frame;
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
            self.checker.is_free(&pose, level, depth)
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

/// Rotations that differ by less than this are one (by the cosine of half the angle: a microradian).
const SAME: f64 = 1e-13;
/// Motions that make a smaller angle than this with each other have no corner to meet in (its squared
/// sine).
const PARALLEL: f64 = 0.02;
/// A straight motion goes on by these shares of what brings it nearest to where the path leads.
const FURTHER: [f64; 3] = [1.0, 0.6, 0.3];
/// What goes straight on outside may be so many times as long as what it replaces.
const LONGER: [f64; 4] = [1.0, 1.5, 2.0, 3.0];

impl SearchSpace<'_> {
    /// Removes vertices between straight motions where the others suffice: with play, a corner is cut. The
    /// last pose stays, and the first if `keep_start`.
    pub(crate) fn reduce_vertices(&self, corners: Vec<Pose>, keep_start: bool) -> Vec<Pose> {
        let mut path = corners;
        while !(self.stop)() {
            let straight_in = || (!keep_start).then(|| self.straight_in(&path)).flatten();
            let found = self
                .drop_vertex(&path)
                .or_else(|| self.merge_three(&path))
                .or_else(straight_in);
            let Some(found) = found else {
                break;
            };
            path = found;
        }
        path
    }

    /// Two straight motions, one after the other, as one.
    fn drop_vertex(&self, path: &[Pose]) -> Option<Vec<Pose>> {
        let straight = |w: &[Pose]| same_rotation(&w[0], &w[1]) && same_rotation(&w[1], &w[2]);
        let i =
            (path.windows(3)).position(|w| straight(w) && self.is_free_between(&w[0], &w[2]))?;
        Some([&path[..=i], &path[i + 2..]].concat())
    }

    /// Three straight motions, one after the other, as two of them.
    fn merge_three(&self, path: &[Pose]) -> Option<Vec<Pose>> {
        (0..path.len().saturating_sub(3)).find_map(|i| {
            let of: &[Pose; 4] = path[i..i + 4].try_into().ok()?;
            let corner = self.common_corner(of)?;
            Some([&path[..=i], &[corner], &path[i + 3..]].concat())
        })
    }

    /// Where two of three straight motions lead by themselves from the first pose to the last.
    fn common_corner(&self, of: &[Pose; 4]) -> Option<Pose> {
        if of[1..].iter().any(|p| !same_rotation(&of[0], p)) {
            return None;
        }
        let [a, b, c, d] = of.map(|p| p.translation);
        let [first, second, third] = [b - a, c - b, d - c].map(DVec3::normalize_or_zero);
        let meeting = [(first, third), (first, second), (second, third)];
        let corners = meeting.map(|(out, back)| closest_point(a, out, d, back));
        let beyond = |from: DVec3, out: DVec3, to: DVec3| {
            let far = (to - from).dot(out).max(0.0);
            FURTHER.map(|share| from + share * far * out)
        };
        let found = corners.into_iter().flatten();
        let found = found.chain(beyond(b, first, d));
        let mut found = found.chain(beyond(c, -third, a));
        found.find_map(|translation| {
            let corner = Pose {
                translation,
                ..of[0]
            };
            let joins =
                self.is_free_between(&of[0], &corner) && self.is_free_between(&corner, &of[3]);
            joins.then_some(corner)
        })
    }

    /// The first of two straight motions left out: the second begins as far outside, within a step.
    fn straight_in(&self, path: &[Pose]) -> Option<Vec<Pose>> {
        let [outside, corner, next, ..] = path else {
            return None;
        };
        if !(same_rotation(outside, corner) && same_rotation(corner, next)) {
            return None;
        }
        let far = outside.translation.distance(corner.translation);
        let back = (corner.translation - next.translation).try_normalize()?;
        let gap = |pose: &Pose| -self.exit(pose).distance;
        let enough = gap(outside) - self.step;
        let start = LONGER.map(|longer| Pose {
            translation: corner.translation + longer * far * back,
            ..*corner
        });
        let start = start.into_iter().find(|start| gap(start) >= enough)?;
        let joins = self.is_free_between(&start, next);
        joins.then(|| [&[start], &path[2..]].concat())
    }
}

fn same_rotation(a: &Pose, b: &Pose) -> bool {
    a.rotation.dot(b.rotation).abs() > 1.0 - SAME
}

/// Where paths from `a` along `out` and to `d` along `back`, unit vectors, come closest: on the second.
/// None if they are parallel, or would lead the other way.
fn closest_point(a: DVec3, out: DVec3, d: DVec3, back: DVec3) -> Option<DVec3> {
    let (between, cosine) = (d - a, out.dot(back));
    let sine_squared = 1.0 - cosine * cosine;
    let before = (between.dot(back) - between.dot(out) * cosine) / sine_squared;
    let after = between.dot(out) - before * cosine;
    (sine_squared > PARALLEL && before > 0.0 && after > 0.0).then(|| d - before * back)
}

#[cfg(test)]
mod tests {
    use sdf_grid::shapes;

    use super::*;
    use crate::search::space::testing::Pair;

    const LEVEL: f64 = 2e-5;

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
        let pair = Pair::new((hole, peg), &Pose::IDENTITY, 5e-4);
        let at = |i: i32| {
            let share = f64::from(i);
            Pose::new(DQuat::from_rotation_z(0.4 * share), DVec3::Z * 0.01 * share)
        };
        let space = pair.space(LEVEL, 5e-4);
        let path: Vec<Pose> = [4, 3, 0].map(at).to_vec();
        for (pose, before) in space.remove_rotations(&path).iter().zip(&path) {
            assert!(pose.rotation.angle_between(DQuat::IDENTITY) < 1e-7);
            assert!((pose.translation - before.translation).length() < 1e-9);
        }
    }

    /// Where the spool leaned it would stand a tenth of a millimetre in the wall.
    #[test]
    fn a_part_that_leaned_in_its_play_is_shifted_upright() {
        let (plate, spool) = pegfit_fixtures::spool_in_slot(2e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_x(-1.1), DVec3::new(0.04, 0.0, -0.02));
        let pair = Pair::new((plate, spool), &place, 2e-4);
        let at = |i: i32, lean: f64| {
            let (x, turn) = (-2e-4 * f64::from(i), DQuat::from_rotation_y(0.05 * lean));
            place * Pose::new(turn, DVec3::new(x, 0.0, 3e-4 * lean))
        };
        let leaning: Vec<Pose> = (0..20).rev().map(|i| at(i, f64::from(i.min(1)))).collect();
        let space = pair.space(LEVEL, 3e-4);
        assert!(!pair.checker.is_free(&at(9, 1.0), LEVEL, 1e-3));
        let path = space.without_rotation(&leaning).unwrap();
        assert_eq!(path[19], leaning[19]);
        for pose in &path {
            assert!(pose.angle_to(&path[19]) < 1e-6 && pair.checker.is_free(pose, LEVEL, 1e-3));
        }
        let wall = place * Pose::from_translation(DVec3::new(0.0, 4e-3, 0.0));
        assert_eq!(
            space.without_rotation(&[&[wall], &path[18..]].concat()),
            None
        );
    }

    #[test]
    fn a_way_round_a_corner_keeps_its_corner() {
        let (plate, spool) = pegfit_fixtures::spool_in_slot(2e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_y(0.8), DVec3::splat(0.02));
        let pair = Pair::new((plate, spool), &place, 2e-4);
        let at = |x: f64, y: f64| place * Pose::from_translation(1e-3 * DVec3::new(x, y, 0.0));
        let mut poses: Vec<Pose> = (0..=16).map(|i| at(-0.5 * f64::from(i), 0.0)).collect();
        poses.extend((1..=24).map(|i| at(-8.0, -0.5 * f64::from(i))));
        let space = pair.space(LEVEL, 2e-4);
        let short = space.shortcut(&poses);
        assert!((3..=4).contains(&short.len()), "{}", short.len());
        assert_eq!((short[0], short[short.len() - 1]), (poses[0], poses[40]));
        let corner = at(-8.0, 0.0);
        assert!(
            short
                .iter()
                .any(|p| pair.checker.frame.apart(p, &corner) < 6e-4)
        );
    }

    /// Along x, down across, along y: the corner is where both axes meet.
    #[test]
    fn ways_meet_where_they_come_closest() {
        let d = DVec3::new(4.0, 5.0, 0.5);
        let found = closest_point(DVec3::ZERO, DVec3::X, d, DVec3::Y).unwrap();
        assert!((found - DVec3::new(4.0, 0.0, 0.5)).length() < 1e-12);
        assert_eq!(closest_point(DVec3::ZERO, DVec3::X, d, DVec3::X), None);
        assert_eq!(closest_point(DVec3::ZERO, -DVec3::X, d, DVec3::Y), None);
    }

    /// The spool goes up and across; on its path it strayed in the slot and outside of it.
    #[test]
    fn a_corner_that_is_cut_in_the_play_is_one_corner() {
        let (plate, spool) = pegfit_fixtures::spool_in_slot(5e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_y(0.8), DVec3::new(0.02, -0.03, 0.01));
        let pair = Pair::new((plate, spool), &place, 2e-4);
        let space = pair.space(LEVEL, 3e-4);
        // Turned by no more than rounding.
        let turn = |x: f64| DQuat::from_rotation_z(1e-8 * x);
        let at = |x: f64, y: f64| place * Pose::new(turn(x), 1e-3 * DVec3::new(x, y, 0.0));
        let strayed = [
            at(-14.0, -30.0),
            at(-8.0, -16.0),
            at(-8.0, -0.4),
            at(-1.4, -0.4),
            at(0.0, 0.0),
        ];
        for joined in strayed.windows(2) {
            assert!(space.is_free_between(&joined[0], &joined[1]));
        }
        let found = space.reduce_vertices(strayed.to_vec(), false);
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(found[2], strayed[4]);
        assert!((found[1].translation - strayed[2].translation).length() < 1e-3);
        let cut = [at(-8.0, -16.0), at(-7.5, -0.7), at(-1.3, 0.1), at(0.0, 0.0)];
        let straight = space.reduce_vertices(cut.to_vec(), true);
        assert_eq!(straight.len(), 3, "{straight:?}");
        let kept = space.reduce_vertices(strayed.to_vec(), true);
        assert_eq!((kept.len(), kept[0]), (4, strayed[0]));
    }
}
