//! Exit paths of one motion from beginning to end: a push, or the screw of a thread.
//!
//! Step by step, a part wanders in its play, the more the looser it sits; a single screw does not. The
//! search begins along what the walls resist least and follows the motion ever farther, corrected so that
//! the part stays off the walls.

use std::time::Instant;

use fft_correlate::Pose;
use rayon::prelude::*;

use crate::collision::checker::Allowed;
use crate::motion::vec6::{LeastSquares, Vec6, dot, length, scaled};
use crate::search::directions::candidates;
use crate::search::exit::ExitPath;
use crate::search::space::SearchSpace;

/// Directions that are tried: the shortest exit and both senses of the softest.
const TRIED: usize = 5;
/// A motion is first followed for so many steps, then each time so many times as far.
const FIRST: f64 = 8.0;
const GROWTH: f64 = 1.5;
/// Until the motion leads outside, only every n-th step is checked.
const SPARSE: f64 = 3.0;
/// Most corrections at each length.
const CORRECTIONS: usize = 6;
/// Corrections leave at least this share of a motion's length, or the motion is given up.
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

/// A search for exits by one motion.
pub(crate) struct SingleMotion<'a> {
    pub(crate) space: SearchSpace<'a>,
    pub(crate) deadline: Instant,
}

impl SingleMotion<'_> {
    /// Paths out of `start`, each of one motion, with poses a step apart: the first one found, or all
    /// that differ. Pushes come first.
    pub(crate) fn paths(&self, start: &Pose, all: bool) -> Vec<ExitPath> {
        let (level, exit) = (self.space.limits.level, self.space.exit(start));
        let contacts = &mut Vec::new();
        let mut tried = candidates(
            self.space.checker,
            start,
            level,
            None,
            exit.direction,
            contacts,
        );
        tried.truncate(TRIED);
        let mut tried: Vec<(Vec6, Allowed)> = tried.iter().flat_map(upright_first).collect();
        let turns = |motion: &Vec6| self.space.checker.frame.turn(motion).length() > 0.0;
        tried.sort_by_key(|(motion, _)| turns(motion));
        let mut paths: Vec<ExitPath> = Vec::new();
        for (motion, by) in tried {
            let found = self.path(start, &motion, by);
            paths.extend(found.filter(|path| path.differs_from(&paths)));
            if !(all || paths.is_empty()) {
                break;
            }
        }
        paths
    }

    fn path(&self, start: &Pose, direction: &Vec6, by: Allowed) -> Option<ExitPath> {
        let (checker, frame) = (self.space.checker, &self.space.checker.frame);
        let within = 3.0 * self.space.limits.tolerance;
        if self
            .space
            .duplicates
            .is_symmetric_motion(checker, start, direction, within)
        {
            return None;
        }
        let sparse = SPARSE * self.space.step;
        let first = FIRST * self.space.step / frame.largest(start, direction);
        let mut motion = scaled(direction, first);
        let exit = self.space.exit(start).distance;
        while !self.stopped() {
            let wanted = frame.largest(start, &motion);
            motion = self.cleared(start, motion, sparse, by)?;
            if frame.largest(start, &motion) < SHORTER * wanted {
                return None;
            }
            let end = frame.moved(start, &motion);
            let gained = exit - self.space.exit(&end).distance;
            if gained > exit {
                motion = self.cleared(start, motion, self.space.step, by)?;
                return self.outwards(start, &motion);
            }
            let turns = (frame.turn(&motion).length() / std::f64::consts::TAU).floor();
            if turns > 0.0 && gained < CLOSER * self.space.step * turns {
                return None;
            }
            motion = scaled(&motion, GROWTH);
        }
        None
    }

    fn stopped(&self) -> bool {
        (self.space.stop)() || Instant::now() > self.deadline
    }

    /// A motion next to this one that is within the limits all along, checked every `spacing` metres.
    fn cleared(&self, start: &Pose, mut motion: Vec6, spacing: f64, by: Allowed) -> Option<Vec6> {
        // Denser checks must still pass.
        let level = self.space.limits.level - SPARE * self.space.limits.tolerance;
        // What is no deeper than the level at one pose is hardly deeper at the next than they are apart.
        let depth = level + BEYOND * spacing;
        for correction in 0..=CORRECTIONS {
            let poses = self.poses(start, &motion, spacing);
            if (poses.par_iter()).all(|p| self.space.checker.is_free(p, level, depth)) {
                return Some(motion);
            }
            if correction < CORRECTIONS && !self.stopped() {
                let room = self.space.step * 0.5f64.powi(correction as i32);
                motion = self.corrected(start, &motion, poses.len(), (room, by))?;
            }
        }
        None
    }

    /// Poses along a motion, the last one at its end.
    fn poses(&self, start: &Pose, motion: &Vec6, spacing: f64) -> Vec<Pose> {
        let frame = &self.space.checker.frame;
        let count = (frame.largest(start, motion) / spacing).ceil().max(1.0) as usize;
        let at = |i: usize| frame.moved(start, &scaled(motion, i as f64 / count as f64));
        (1..=count).map(at).collect()
    }

    /// The motion that opens all narrow gaps at `count` poses along this one (least squares).
    fn corrected(
        &self,
        start: &Pose,
        motion: &Vec6,
        count: usize,
        (room, by): (f64, Allowed),
    ) -> Option<Vec6> {
        let aim = room.max(3.0 * self.space.limits.tolerance) - self.space.limits.level;
        let each = (1..=count).into_par_iter();
        let sums = each.fold(LeastSquares::default, |mut sums, i| {
            self.add(start, motion, i as f64 / count as f64, (aim, by), &mut sums);
            sums
        });
        let sums = sums.reduce(LeastSquares::default, LeastSquares::plus);
        let change = sums.solution()?;
        let changed = |share: f64| std::array::from_fn(|i| motion[i] + share * change[i]);
        let frame = &self.space.checker.frame;
        let end = frame.moved(start, motion);
        let moved = frame.apart(&end, &frame.moved(start, &changed(1.0)));
        Some(changed((REACH * self.space.step / moved).min(1.0)))
    }

    /// Adds the contacts after a share of a motion to the equations for a change of the whole motion.
    fn add(
        &self,
        start: &Pose,
        motion: &Vec6,
        share: f64,
        (aim, by): (f64, Allowed),
        sums: &mut LeastSquares,
    ) {
        let frame = &self.space.checker.frame;
        let depth = self.space.limits.depth(REACH * self.space.step);
        let pose = frame.moved(start, &scaled(motion, share));
        let mut contacts = Vec::new();
        if self
            .space
            .checker
            .collect_contacts(&pose, aim, depth, &mut contacts)
            >= aim
        {
            return;
        }
        let small = SMALL * self.space.step;
        let columns: [Vec6; 6] = std::array::from_fn(|i| {
            if by == Allowed::Translations && i < 3 {
                return [0.0; 6];
            }
            let mut other = *motion;
            other[i] += small;
            let there = frame.moved(start, &scaled(&other, share));
            scaled(&frame.between(&pose, &there), 1.0 / small)
        });
        for contact in contacts {
            let slope = std::array::from_fn(|i| dot(&contact.slope, &columns[i]));
            sums.add(&slope, aim - contact.distance);
        }
    }

    /// The poses of a motion until the part is outside.
    fn outwards(&self, start: &Pose, motion: &Vec6) -> Option<ExitPath> {
        let mut poses = vec![*start];
        for pose in self.poses(start, motion, self.space.step) {
            poses.push(pose);
            let exit = self.space.exit(&pose);
            if exit.distance < 0.0 {
                return Some(ExitPath { poses, exit });
            }
        }
        None
    }
}

/// A unit motion; if it turns little, its translation is tried before it, without rotations.
fn upright_first(motion: &Vec6) -> impl Iterator<Item = (Vec6, Allowed)> + use<> {
    let [x, y, z, along @ ..] = *motion;
    let leans = length(&[x, y, z, 0.0, 0.0, 0.0]);
    let push = [0.0, 0.0, 0.0, along[0], along[1], along[2]];
    let upright = (leans < LEANING).then_some((push, Allowed::Translations));
    upright.into_iter().chain([(*motion, Allowed::All)])
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::{DQuat, DVec3};
    use sdf_grid::{TriangleMesh, shapes};

    use super::*;
    use crate::collision::checker::CollisionChecker;
    use crate::motion::describe::{Motion, describe_motions};
    use crate::search::space::testing::Pair;

    /// Paths of a pair that was made in place, turned and shifted, and the turned axis z.
    fn paths(parts: (TriangleMesh, TriangleMesh)) -> (Vec<ExitPath>, CollisionChecker, DVec3) {
        let place = Pose::new(
            DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 0.4)),
            DVec3::new(0.03, -0.01, 0.02),
        );
        let radius = parts.1.radius_about(parts.1.centroid());
        let pair = Pair::new(parts, &place, radius / 40.0);
        let search = SingleMotion {
            space: pair.space(1e-3 * radius, radius / 30.0),
            deadline: Instant::now() + Duration::from_secs(600),
        };
        let found = search.paths(&place, true);
        for path in &found {
            assert_eq!(path.poses[0], place);
            let (level, depth) = (search.space.limits.level, 4.0 * search.space.step);
            let free = |p: &Pose| pair.checker.is_free(p, level, depth);
            assert!(path.poses.iter().all(free));
        }
        (found, pair.checker, place.rotation * DVec3::Z)
    }

    /// Description, by poses that are far apart.
    fn described(checker: &CollisionChecker, path: &ExitPath) -> Vec<Motion> {
        let (end, rest) = path.poses.split_last().unwrap();
        let some = rest.iter().step_by(20).chain([end]).copied();
        describe_motions(&checker.frame, &some.collect::<Vec<_>>())
    }

    #[test]
    fn a_loose_nut_comes_off_by_one_screw_of_the_pitch() {
        let thread = pegfit_fixtures::Thread {
            pitch: 1e-3,
            radius: 0.005,
            depth: 4e-4,
            right_handed: true,
            segments: 32,
        };
        let bolt = thread.bolt(4e-3, [0.008, 0.003]).unwrap();
        let nut = thread.nut([2e-4, 2.2e-3], 0.016, 2.5e-4).unwrap();
        let (found, checker, axis) = paths((bolt, nut));
        assert_eq!(found.len(), 1);
        let described = described(&checker, &found[0]);
        assert_eq!(described.len(), 1, "{described:?}");
        assert!(
            (described[0].pitch().unwrap() - 1e-3).abs() < 1e-4,
            "{described:?}"
        );
        let along = described[0].advance.signum() * DVec3::from_array(described[0].axis);
        assert!(along.angle_between(axis) < 0.1, "{described:?}");
    }

    #[test]
    fn pegs_come_out_by_a_push_and_what_needs_two_motions_by_none() {
        let (found, checker, axis) = paths(shapes::PegInHole::Circular.pair(1e-4).unwrap());
        assert_eq!(found.len(), 2);
        for path in &found {
            let described = described(&checker, path);
            let along = DVec3::from_array(described[0].axis).dot(axis).abs();
            assert!(
                described.len() == 1 && described[0].turn == 0.0 && along > 0.99,
                "{described:?}"
            );
        }
        assert!(paths(pegfit_fixtures::bayonet(2e-4).unwrap()).0.is_empty());
        assert!(
            paths(pegfit_fixtures::captive_ball(2e-4, 5e-4).unwrap())
                .0
                .is_empty()
        );
    }
}
