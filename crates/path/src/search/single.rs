//! Ways out by one motion from beginning to end: a push, or the screw of a thread.
//!
//! Step by step a part wanders in its play, the more the looser it sits; one screw through all of its
//! way does not. It begins along what the walls resist least and is followed ever farther, corrected
//! so that the part stays off the walls all along.

use std::time::Instant;

use fft_correlate::Pose;
use rayon::prelude::*;

use crate::contact::gaps::Gaps;
use crate::contact::settle::{By, Limits};
use crate::motion::six::{Mat6, Vec6, add_product, dot, length, scaled, solve_damped};
use crate::search::directions::candidates;
use crate::search::escape::Escape;
use crate::search::grow::Way;
use crate::search::same::Shape;

/// Directions that are tried: the shortest way out and both senses of the softest.
const TRIED: usize = 5;
/// A motion is first looked at so many steps far, then each time so many times as far.
const FIRST: f64 = 8.0;
const GROWTH: f64 = 1.5;
/// Until it leads outside only every so manieth step is looked at.
const SPARSE: f64 = 3.0;
/// Most corrections at each length.
const CORRECTIONS: usize = 6;
/// What corrections leave of the length of a motion that leads on, at least.
const SHORTER: f64 = 0.9;
/// No correction moves the end by more than so many steps.
const REACH: f64 = 2.0;
/// How many spacings deeper than allowed overlaps are seen.
const BEYOND: f64 = 1.5;
/// Overlaps are less than allowed by this share of the tolerance.
const SPARE: f64 = 0.5;
/// The part has to come nearer to being out by this share of a step in every full turn.
const CLOSER: f64 = 0.2;
/// Share of a step by which slopes of poses are taken.
const SMALL: f64 = 1e-3;
/// What turns by less than this share of a motion may do so for its play alone.
const LEANING: f64 = 0.2;

/// Stiffness of contacts, and what they ask for.
type Sums = (Mat6, Vec6);

/// What single motions out are looked for in.
pub(crate) struct Single<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) escape: &'a Escape,
    pub(crate) shape: &'a Shape,
    pub(crate) limits: Limits,
    /// Poses are looked at this far apart, metres.
    pub(crate) step: f64,
    pub(crate) deadline: Instant,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

impl Single<'_> {
    /// Ways out of `start`, each of one motion, with poses a step apart: the first one found, or all
    /// that differ. Pushes come first.
    pub(crate) fn ways(&self, start: &Pose, all: bool) -> Vec<Way> {
        let (level, exit) = (self.limits.level, self.escape.exit(self.gaps, start));
        let contacts = &mut Vec::new();
        let mut tried = candidates(self.gaps, start, level, None, exit.direction, contacts);
        tried.truncate(TRIED);
        let mut tried: Vec<(Vec6, By)> = tried.iter().flat_map(upright_first).collect();
        let turns = |motion: &Vec6| self.gaps.frame.turn(motion).length() > 0.0;
        tried.sort_by_key(|(motion, _)| turns(motion));
        let mut ways: Vec<Way> = Vec::new();
        for (motion, by) in tried {
            let found = self.way(start, &motion, by);
            ways.extend(found.filter(|way| way.differs_from(&ways)));
            if !(all || ways.is_empty()) {
                break;
            }
        }
        ways
    }

    fn way(&self, start: &Pose, direction: &Vec6, by: By) -> Option<Way> {
        let (gaps, frame) = (self.gaps, &self.gaps.frame);
        let within = 3.0 * self.limits.tolerance;
        if self.shape.turns_in_itself(gaps, start, direction, within) {
            return None;
        }
        let sparse = SPARSE * self.step;
        let first = FIRST * self.step / frame.largest(start, direction);
        let mut motion = scaled(direction, first);
        let exit = self.escape.exit(gaps, start).distance;
        while !self.stopped() {
            let wanted = frame.largest(start, &motion);
            motion = self.cleared(start, motion, sparse, by)?;
            if frame.largest(start, &motion) < SHORTER * wanted {
                return None;
            }
            let end = frame.moved(start, &motion);
            let gained = exit - self.escape.exit(gaps, &end).distance;
            if gained > exit {
                motion = self.cleared(start, motion, self.step, by)?;
                return self.outwards(start, &motion);
            }
            let turns = (frame.turn(&motion).length() / std::f64::consts::TAU).floor();
            if turns > 0.0 && gained < CLOSER * self.step * turns {
                return None;
            }
            motion = scaled(&motion, GROWTH);
        }
        None
    }

    fn stopped(&self) -> bool {
        (self.stop)() || Instant::now() > self.deadline
    }

    /// A motion next to this one that is within the limits all along, looked at every `spacing` metres.
    fn cleared(&self, start: &Pose, mut motion: Vec6, spacing: f64, by: By) -> Option<Vec6> {
        // Looked at more closely it must still do.
        let level = self.limits.level - SPARE * self.limits.tolerance;
        // What is no deeper than the level at one pose is hardly deeper at the next than they are apart.
        let depth = level + BEYOND * spacing;
        for correction in 0..=CORRECTIONS {
            let poses = self.poses(start, &motion, spacing);
            if (poses.par_iter()).all(|p| self.gaps.clear(p, level, depth)) {
                return Some(motion);
            }
            if correction < CORRECTIONS && !self.stopped() {
                let room = self.step * 0.5f64.powi(correction as i32);
                motion = self.corrected(start, &motion, poses.len(), (room, by))?;
            }
        }
        None
    }

    /// Poses along a motion, the last one at its end.
    fn poses(&self, start: &Pose, motion: &Vec6, spacing: f64) -> Vec<Pose> {
        let frame = &self.gaps.frame;
        let count = (frame.largest(start, motion) / spacing).ceil().max(1.0) as usize;
        let at = |i: usize| frame.moved(start, &scaled(motion, i as f64 / count as f64));
        (1..=count).map(at).collect()
    }

    /// The motion that opens all gaps that are too narrow at some of `count` poses along this one, in the
    /// mean square.
    fn corrected(
        &self,
        start: &Pose,
        motion: &Vec6,
        count: usize,
        (room, by): (f64, By),
    ) -> Option<Vec6> {
        let aim = room.max(3.0 * self.limits.tolerance) - self.limits.level;
        let zero = || ([[0.0; 6]; 6], [0.0; 6]);
        let each = (1..=count).into_par_iter();
        let sums = each.fold(zero, |mut sums, i| {
            self.add(start, motion, i as f64 / count as f64, (aim, by), &mut sums);
            sums
        });
        let (stiffness, pull) = sums.reduce(zero, |mut a, b| {
            for i in 0..6 {
                a.1[i] += b.1[i];
                (0..6).for_each(|k| a.0[i][k] += b.0[i][k]);
            }
            a
        });
        let change = solve_damped(stiffness, pull).filter(|x| length(x) > 0.0)?;
        let changed = |share: f64| std::array::from_fn(|i| motion[i] + share * change[i]);
        let frame = &self.gaps.frame;
        let end = frame.moved(start, motion);
        let moved = frame.apart(&end, &frame.moved(start, &changed(1.0)));
        Some(changed((REACH * self.step / moved).min(1.0)))
    }

    /// Adds how contacts after a share of a motion resist changes of the whole, and ask for them.
    fn add(&self, start: &Pose, motion: &Vec6, share: f64, (aim, by): (f64, By), sums: &mut Sums) {
        let frame = &self.gaps.frame;
        let depth = self.limits.depth(REACH * self.step);
        let pose = frame.moved(start, &scaled(motion, share));
        let mut contacts = Vec::new();
        if self.gaps.near(&pose, aim, depth, &mut contacts) >= aim {
            return;
        }
        let small = SMALL * self.step;
        let columns: [Vec6; 6] = std::array::from_fn(|i| {
            if by == By::Shifts && i < 3 {
                return [0.0; 6];
            }
            let mut other = *motion;
            other[i] += small;
            let there = frame.moved(start, &scaled(&other, share));
            scaled(&frame.between(&pose, &there), 1.0 / small)
        });
        for contact in contacts {
            let slope = std::array::from_fn(|i| dot(&contact.slope, &columns[i]));
            add_product(&mut sums.0, &slope, 1.0);
            for (pull, s) in sums.1.iter_mut().zip(&slope) {
                *pull += (aim - contact.distance) * s;
            }
        }
    }

    /// The poses of a motion as far as outside.
    fn outwards(&self, start: &Pose, motion: &Vec6) -> Option<Way> {
        let mut poses = vec![*start];
        for pose in self.poses(start, motion, self.step) {
            poses.push(pose);
            let exit = self.escape.exit(self.gaps, &pose);
            if exit.distance < 0.0 {
                return Some(Way { poses, exit });
            }
        }
        None
    }
}

/// A unit motion, and before it, if it turns little or not at all, its push, which stays one.
fn upright_first(motion: &Vec6) -> impl Iterator<Item = (Vec6, By)> + use<> {
    let [x, y, z, along @ ..] = *motion;
    let leans = length(&[x, y, z, 0.0, 0.0, 0.0]);
    let push = [0.0, 0.0, 0.0, along[0], along[1], along[2]];
    let upright = (leans < LEANING).then_some((push, By::Shifts));
    upright.into_iter().chain([(*motion, By::Any)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::Body;
    use crate::motion::words::{Motion, motions};
    use glam::{DQuat, DVec3};
    use pegfit_fixtures as shapes;
    use sdf_grid::TriangleMesh;
    use std::sync::Arc;
    use std::time::Duration;

    /// Ways of a pair that was made in place, turned and shifted, and the turned axis z.
    fn ways(parts: (TriangleMesh, TriangleMesh)) -> (Vec<Way>, Gaps, DVec3) {
        let place = Pose::new(
            DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 0.4)),
            DVec3::new(0.03, -0.01, 0.02),
        );
        let fixed = parts.0.transformed(place.rotation, place.translation);
        let moving = Body::of_mesh(Arc::new(parts.1));
        let radius = moving.radius_about(moving.centroid());
        let gaps = Gaps::new(Body::of_mesh(Arc::new(fixed)), moving, radius / 40.0);
        let single = Single {
            gaps: &gaps,
            escape: &Escape::new(&gaps),
            shape: &Shape::new(&gaps),
            limits: Limits {
                level: 1e-3 * radius,
                tolerance: 1e-3 * radius,
            },
            step: radius / 30.0,
            deadline: Instant::now() + Duration::from_secs(600),
            stop: &|| false,
        };
        let found = single.ways(&place, true);
        for way in &found {
            assert_eq!(way.poses[0], place);
            let level = single.limits.level;
            assert!(
                way.poses
                    .iter()
                    .all(|p| gaps.clear(p, level, 4.0 * single.step))
            );
        }
        (found, gaps, place.rotation * DVec3::Z)
    }

    /// In words, by poses that are far apart.
    fn told(gaps: &Gaps, way: &Way) -> Vec<Motion> {
        let (end, rest) = way.poses.split_last().unwrap();
        let some = rest.iter().step_by(20).chain([end]).copied();
        motions(&gaps.frame, &some.collect::<Vec<_>>())
    }

    #[test]
    fn a_loose_nut_comes_off_by_one_screw_of_the_pitch() {
        let thread = shapes::Thread {
            pitch: 1e-3,
            radius: 0.005,
            depth: 4e-4,
            right_handed: true,
            segments: 32,
        };
        let bolt = thread.bolt(4e-3, [0.008, 0.003]).unwrap();
        let nut = thread.nut([2e-4, 2.2e-3], 0.016, 2.5e-4).unwrap();
        let (found, gaps, axis) = ways((bolt, nut));
        assert_eq!(found.len(), 1);
        let told = told(&gaps, &found[0]);
        assert_eq!(told.len(), 1, "{told:?}");
        assert!((told[0].pitch().unwrap() - 1e-3).abs() < 1e-4, "{told:?}");
        let along = told[0].advance.signum() * DVec3::from_array(told[0].axis);
        assert!(along.angle_between(axis) < 0.1, "{told:?}");
    }

    #[test]
    fn pegs_come_out_by_a_push_and_what_needs_two_motions_by_none() {
        let (found, gaps, axis) = ways(shapes::PegInHole::Circular.pair(1e-4).unwrap());
        assert_eq!(found.len(), 2);
        for way in &found {
            let told = told(&gaps, way);
            let along = DVec3::from_array(told[0].axis).dot(axis).abs();
            assert!(
                told.len() == 1 && told[0].turn == 0.0 && along > 0.99,
                "{told:?}"
            );
        }
        assert!(ways(shapes::bayonet(2e-4).unwrap()).0.is_empty());
        assert!(ways(shapes::captive_ball(2e-4, 5e-4).unwrap()).0.is_empty());
    }
}
