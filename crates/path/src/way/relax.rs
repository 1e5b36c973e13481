//! Away from walls and down the energy, each pose across the way.

use fft_correlate::{EnergySource, Pose};
use rayon::prelude::*;

use crate::contact::gaps::Gaps;
use crate::contact::settle::{By, Limits};
use crate::motion::six::{Vec6, dot, length, scaled};

/// Most rounds of relaxing.
const ROUNDS: usize = 6;

/// What a way is relaxed in.
pub(crate) struct Relaxation<'a> {
    pub(crate) gaps: &'a Gaps,
    pub(crate) limits: Limits,
    /// Longest motion of a pose in one round, metres.
    pub(crate) step: f64,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

impl Relaxation<'_> {
    /// The poses of a way, all but the ends pushed off what they touch; poses that cannot be stay.
    pub(crate) fn off_walls(&self, poses: &[Pose]) -> Vec<Pose> {
        let last = poses.len() - 1;
        let settled = |(i, pose): (usize, &Pose)| {
            if i == 0 || i == last || (self.stop)() {
                return *pose;
            }
            let mut contacts = Vec::new();
            let found = self
                .gaps
                .settle(pose, &self.limits, self.step, By::Any, &mut contacts);
            found.unwrap_or(*pose)
        };
        poses.par_iter().enumerate().map(settled).collect()
    }

    /// The string method: every pose but the ends goes down the energy across the way, off what it
    /// touches; a pose moves only if its energy falls.
    pub(crate) fn down(&self, poses: &[Pose], source: &dyn EnergySource) -> Vec<Pose> {
        let mut way = poses.to_vec();
        for round in 0..ROUNDS {
            let step = self.step * 0.7f64.powi(round as i32);
            let moved: Vec<Pose> = (0..way.len())
                .into_par_iter()
                .map(|i| match i == 0 || i + 1 == way.len() || (self.stop)() {
                    true => way[i],
                    false => self.lower(source, [&way[i - 1], &way[i], &way[i + 1]], step),
                })
                .collect();
            way = moved;
        }
        way
    }

    /// The middle one of three poses after a step across the way.
    fn lower(&self, source: &dyn EnergySource, [a, pose, b]: [&Pose; 3], step: f64) -> Pose {
        let frame = &self.gaps.frame;
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
            let trial = self
                .gaps
                .settle(&trial, &self.limits, step, By::Any, &mut contacts)?;
            (source.evaluate(&trial, &mut scratch).energy < at.energy).then_some(trial)
        });
        tried.unwrap_or(*pose)
    }
}
