//! Smoothing: poses at equal steps, moved away from walls and down the energy.

use fft_correlate::{EnergySource, Pose};
use rayon::prelude::*;

use crate::collision::checker::Allowed;
use crate::motion::frame::Frame;
use crate::motion::vec6::{Vec6, dot, length, scaled};
use crate::search::space::SearchSpace;

/// Rounds of descending.
const ROUNDS: usize = 6;

impl SearchSpace<'_> {
    /// Projects all poses but the ends away from what they touch; poses that cannot move stay.
    pub(crate) fn away_from_walls(&self, poses: &[Pose]) -> Vec<Pose> {
        let last = poses.len() - 1;
        let settled = |(i, pose): (usize, &Pose)| {
            if i == 0 || i == last || (self.stop)() {
                return *pose;
            }
            let mut contacts = Vec::new();
            let found = self.checker.project_to_contact(
                pose,
                &self.limits,
                self.step,
                Allowed::All,
                &mut contacts,
            );
            found.unwrap_or(*pose)
        };
        poses.par_iter().enumerate().map(settled).collect()
    }

    /// The string method: every pose but the ends descends the energy across the path, away from what it
    /// touches; a pose moves only if its energy falls.
    pub(crate) fn descend_energy(&self, poses: &[Pose], source: &dyn EnergySource) -> Vec<Pose> {
        let mut path = poses.to_vec();
        for round in 0..ROUNDS {
            let step = self.step * 0.7f64.powi(round as i32);
            let moved: Vec<Pose> = (0..path.len())
                .into_par_iter()
                .map(|i| match i == 0 || i + 1 == path.len() || (self.stop)() {
                    true => path[i],
                    false => self.descend(source, [&path[i - 1], &path[i], &path[i + 1]], step),
                })
                .collect();
            path = moved;
        }
        path
    }

    /// The middle one of three poses after a step across the path.
    fn descend(&self, source: &dyn EnergySource, [a, pose, b]: [&Pose; 3], step: f64) -> Pose {
        let frame = &self.checker.frame;
        let mut scratch = source.scratch();
        let at = source.evaluate(pose, &mut scratch);
        let wrench = at.wrench.about(pose.rotation * frame.centre);
        let (t, f) = (wrench.torque / frame.radius, wrench.force);
        let force: Vec6 = [t.x, t.y, t.z, f.x, f.y, f.z];
        let along = frame.between(a, b);
        let share = dot(&force, &along) / dot(&along, &along).max(f64::MIN_POSITIVE);
        let across: Vec6 = std::array::from_fn(|k| force[k] - share * along[k]);
        let size = length(&across);
        if size.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return *pose;
        }
        let mut contacts = Vec::new();
        let tried = [1.0, 0.3].iter().find_map(|shorter| {
            let trial = frame.moved(pose, &scaled(&across, shorter * step / size));
            let trial = self.checker.project_to_contact(
                &trial,
                &self.limits,
                step,
                Allowed::All,
                &mut contacts,
            )?;
            (source.evaluate(&trial, &mut scratch).energy < at.energy).then_some(trial)
        });
        tried.unwrap_or(*pose)
    }
}

/// Poses along the screw motions between `corners`, both ends among them. No point of the part moves by
/// more than `step` metres from one to the next, or by a little more where there would be more than
/// `most` poses.
pub(crate) fn equal_steps(frame: &Frame, corners: &[Pose], step: f64, most: usize) -> Vec<Pose> {
    let pairs = corners.windows(2);
    let lengths: Vec<f64> = pairs
        .map(|w| frame.largest(&w[0], &frame.between(&w[0], &w[1])))
        .collect();
    let whole: f64 = lengths.iter().sum();
    let step = step.max(whole / most.max(1) as f64);
    let mut poses = vec![corners[0]];
    for (w, length) in corners.windows(2).zip(&lengths) {
        let count = (length / step - 1e-9).ceil().max(1.0);
        let at = |i: usize| frame.interpolated(&w[0], &w[1], i as f64 / count);
        poses.extend((1..=count as usize).map(at));
    }
    poses
}
