//! Fewer straight motions.

use fft_correlate::Pose;
use glam::DVec3;

use crate::way::shorten::Shortcuts;

/// Rotations that differ by less than this are one (by the cosine of half the angle: a microradian).
const SAME: f64 = 1e-13;
/// Motions that make a smaller angle than this with each other have no corner to meet in (its squared
/// sine).
const PARALLEL: f64 = 0.02;
/// A straight motion goes on by these shares of what brings it nearest to where the way leads.
const FURTHER: [f64; 3] = [1.0, 0.6, 0.3];
/// What goes straight on outside may be so many times as long as what it replaces.
const LONGER: [f64; 4] = [1.0, 1.5, 2.0, 3.0];

impl Shortcuts<'_> {
    /// The same way with straight motions left out that the others can do without: where there is play
    /// a corner is cut on the way to it. The last pose stays, and the first if it must.
    pub(crate) fn fewer(&self, corners: Vec<Pose>, keep_start: bool) -> Vec<Pose> {
        let mut way = corners;
        while !(self.stop)() {
            let straight_in = || (!keep_start).then(|| self.straight_in(&way)).flatten();
            let found = self
                .one_less(&way)
                .or_else(|| self.merged(&way))
                .or_else(straight_in);
            let Some(found) = found else {
                break;
            };
            way = found;
        }
        way
    }

    /// Two straight motions, one after the other, as one.
    fn one_less(&self, way: &[Pose]) -> Option<Vec<Pose>> {
        let straight = |w: &[Pose]| alike(&w[0], &w[1]) && alike(&w[1], &w[2]);
        let i = (way.windows(3)).position(|w| straight(w) && self.joins(&w[0], &w[2]))?;
        Some([&way[..=i], &way[i + 2..]].concat())
    }

    /// Three straight motions, one after the other, as two of them.
    fn merged(&self, way: &[Pose]) -> Option<Vec<Pose>> {
        (0..way.len().saturating_sub(3)).find_map(|i| {
            let of: &[Pose; 4] = way[i..i + 4].try_into().ok()?;
            let corner = self.corner(of)?;
            Some([&way[..=i], &[corner], &way[i + 3..]].concat())
        })
    }

    /// Where two of three straight motions lead by themselves from the first pose to the last.
    fn corner(&self, of: &[Pose; 4]) -> Option<Pose> {
        if of[1..].iter().any(|p| !alike(&of[0], p)) {
            return None;
        }
        let [a, b, c, d] = of.map(|p| p.translation);
        let [first, second, third] = [b - a, c - b, d - c].map(DVec3::normalize_or_zero);
        let meeting = [(first, third), (first, second), (second, third)];
        let corners = meeting.map(|(out, back)| meet(a, out, d, back));
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
            let joins = self.joins(&of[0], &corner) && self.joins(&corner, &of[3]);
            joins.then_some(corner)
        })
    }

    /// The first of two straight motions left out: the second begins as far outside, within a step.
    fn straight_in(&self, way: &[Pose]) -> Option<Vec<Pose>> {
        let [outside, corner, next, ..] = way else {
            return None;
        };
        if !(alike(outside, corner) && alike(corner, next)) {
            return None;
        }
        let far = outside.translation.distance(corner.translation);
        let back = (corner.translation - next.translation).try_normalize()?;
        let gap = |pose: &Pose| -self.escape.exit(self.gaps, pose).distance;
        let enough = gap(outside) - self.step;
        let start = LONGER.map(|longer| Pose {
            translation: corner.translation + longer * far * back,
            ..*corner
        });
        let start = start.into_iter().find(|start| gap(start) >= enough)?;
        let joins = self.joins(&start, next);
        joins.then(|| [&[start], &way[2..]].concat())
    }
}

fn alike(a: &Pose, b: &Pose) -> bool {
    a.rotation.dot(b.rotation).abs() > 1.0 - SAME
}

/// Where ways from `a` along `out` and to `d` along `back`, unit vectors, come closest: on the second.
/// None if they are parallel, or would lead the other way.
fn meet(a: DVec3, out: DVec3, d: DVec3, back: DVec3) -> Option<DVec3> {
    let (between, cosine) = (d - a, out.dot(back));
    let sine_squared = 1.0 - cosine * cosine;
    let before = (between.dot(back) - between.dot(out) * cosine) / sine_squared;
    let after = between.dot(out) - before * cosine;
    (sine_squared > PARALLEL && before > 0.0 && after > 0.0).then(|| d - before * back)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::Body;
    use crate::contact::gaps::Gaps;
    use crate::contact::settle::Limits;
    use crate::search::escape::Escape;
    use glam::DQuat;
    use pegfit_fixtures as shapes;
    use std::sync::Arc;

    /// Along x, down across, along y: the corner is where both axes meet.
    #[test]
    fn ways_meet_where_they_come_closest() {
        let d = DVec3::new(4.0, 5.0, 0.5);
        let found = meet(DVec3::ZERO, DVec3::X, d, DVec3::Y).unwrap();
        assert!((found - DVec3::new(4.0, 0.0, 0.5)).length() < 1e-12);
        assert_eq!(meet(DVec3::ZERO, DVec3::X, d, DVec3::X), None);
        assert_eq!(meet(DVec3::ZERO, -DVec3::X, d, DVec3::Y), None);
    }

    /// The spool goes up and across; on its way it strayed in the slot and outside of it.
    #[test]
    fn a_corner_that_is_cut_in_the_play_is_one_corner() {
        let (plate, spool) = shapes::spool_in_slot(5e-4).unwrap();
        let place = Pose::new(DQuat::from_rotation_y(0.8), DVec3::new(0.02, -0.03, 0.01));
        let plate = plate.transformed(place.rotation, place.translation);
        let gaps = Gaps::new(
            Body::of_mesh(Arc::new(plate)),
            Body::of_mesh(Arc::new(spool)),
            2e-4,
        );
        let shortcuts = Shortcuts {
            gaps: &gaps,
            escape: &Escape::new(&gaps),
            limits: Limits {
                level: 2e-5,
                tolerance: 2e-5,
            },
            step: 3e-4,
            stop: &|| false,
        };
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
            assert!(shortcuts.joins(&joined[0], &joined[1]));
        }
        let found = shortcuts.fewer(strayed.to_vec(), false);
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(found[2], strayed[4]);
        assert!((found[1].translation - strayed[2].translation).length() < 1e-3);
        let cut = [at(-8.0, -16.0), at(-7.5, -0.7), at(-1.3, 0.1), at(0.0, 0.0)];
        let straight = shortcuts.fewer(cut.to_vec(), true);
        assert_eq!(straight.len(), 3, "{straight:?}");
        let kept = shortcuts.fewer(strayed.to_vec(), true);
        assert_eq!((kept.len(), kept[0]), (4, strayed[0]));
    }
}
