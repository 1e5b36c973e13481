//! Descent of an energy source to the nearest minimum.

use std::collections::VecDeque;

use glam::{DQuat, DVec3};

use crate::energy::{EnergySource, Scratch};
use crate::geometry::se3::Pose;

/// How a pose is refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Descent {
    /// Point of the moving part about which rotations turn, metres in its frame.
    pub pivot: DVec3,
    /// Lever that turns angles into lengths, metres: the part's radius about the pivot.
    pub radius: f64,
    /// Longest first trial step, metres (angle times radius for rotations).
    pub first_step: f64,
    /// A trial step shorter than this ends the descent, metres.
    pub last_step: f64,
    /// Most line searches.
    pub max_steps: usize,
}

/// Slopes within this of a pose tell which ways lead along a valley's floor, and how long a first
/// step along it is, in units of the longest step.
const NEAR: f64 = 0.1;

/// How many shortest means one after the other may not lead down.
const LOOKS: u8 = 3;

/// The square of a mean that is none, per that of a slope.
const HELD: f64 = 1e-12;

/// Against which slope a step goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// The last one, by the metric.
    Metric,
    /// The last one.
    Steepest,
    /// The shortest mean of those near by (Wolfe 1975; Lemaréchal 1978), which did not lead down so
    /// many times: every time more are known.
    Floor(u8),
}

impl Descent {
    /// The lowest pose reached from `start` and its energy, joules; never higher than at `start`.
    ///
    /// A quasi-Newton descent (BFGS) on the source's own wrench with a backtracking line search. At
    /// zero clearance the energy is V-shaped, and slopes on either side of a valley's floor lead
    /// across it: where neither they nor the steepest way lead down, the way goes on against the
    /// shortest mean of the slopes found near by, along the floor. It ends when no step longer than
    /// `last_step` leads down.
    pub fn run(&self, source: &dyn EnergySource, start: &Pose) -> (Pose, f64) {
        let mut downhill = Downhill::new(self, source, start);
        for _ in 0..self.max_steps {
            let Some((direction, longest)) = downhill.direction() else {
                break;
            };
            if !downhill.step(&direction, longest) {
                break;
            }
        }
        (downhill.at.0, downhill.at.1)
    }

    /// How far one pose is from another: of the pivot, and of the part's rim, metres.
    fn apart(&self, a: &Pose, b: &Pose) -> f64 {
        a.apply(self.pivot).distance(b.apply(self.pivot)) + self.radius * a.angle_to(b)
    }

    /// A pose this far from `start`, metres, in a direction that is special to no part.
    pub(super) fn nudged(&self, start: &Pose, length: f64) -> Pose {
        const DIRECTION: Vec6 = [0.34, -0.54, 0.41, -0.31, 0.48, 0.29];
        self.moved(start, &DIRECTION.map(|d| length * d))
    }

    /// Pose, energy, and its gradient along turns (per metre at the radius) and displacements.
    fn at(
        &self,
        source: &dyn EnergySource,
        pose: Pose,
        scratch: &mut Scratch,
    ) -> (Pose, f64, Vec6) {
        let response = source.evaluate(&pose, scratch);
        let arm = pose.rotation * self.pivot;
        let wrench = response.wrench.about(arm);
        let (t, f) = (wrench.torque / self.radius, wrench.force);
        (pose, response.energy, [-t.x, -t.y, -t.z, -f.x, -f.y, -f.z])
    }

    fn moved(&self, pose: &Pose, step: &Vec6) -> Pose {
        let turn = DVec3::new(step[0], step[1], step[2]) / self.radius;
        let pivot = pose.apply(self.pivot) + DVec3::new(step[3], step[4], step[5]);
        let rotation = (DQuat::from_scaled_axis(turn) * pose.rotation).normalize();
        Pose::new(rotation, pivot - rotation * self.pivot)
    }
}

/// A descent on its way.
struct Downhill<'a> {
    descent: &'a Descent,
    source: &'a dyn EnergySource,
    scratch: Scratch,
    /// Pose, energy and slope.
    at: (Pose, f64, Vec6),
    way: Way,
    metric: Metric,
    /// Length of a step that may succeed, metres.
    reach: f64,
    met: Slopes,
    /// Slopes within this are of the same valley, metres.
    near: f64,
}

impl<'a> Downhill<'a> {
    fn new(descent: &'a Descent, source: &'a dyn EnergySource, start: &Pose) -> Self {
        let mut scratch = source.scratch();
        let at = descent.at(source, *start, &mut scratch);
        let mut met = Slopes::default();
        met.push(at.0, at.2);
        Self {
            descent,
            source,
            scratch,
            at,
            way: Way::Steepest,
            metric: Metric::identity(),
            reach: descent.first_step,
            met,
            near: NEAR * descent.first_step,
        }
    }

    /// Where to go, and the longest step as a share of it; none at the bottom.
    fn direction(&mut self) -> Option<(Vec6, f64)> {
        let (pose, _, slope) = &self.at;
        let against = match self.way {
            Way::Metric => self.metric.apply(slope),
            Way::Steepest => *slope,
            Way::Floor(_) => loop {
                let near = |p: &Pose| self.descent.apart(pose, p) <= self.near;
                let shortest = self.met.shortest(near);
                if dot(&shortest, &shortest) >= HELD * dot(slope, slope) {
                    break shortest;
                }
                // Slopes near by hold one another: the bottom is as near.
                self.near *= 0.25;
                if self.near < self.descent.last_step {
                    return None;
                }
            },
        };
        let against = if self.way == Way::Metric && dot(&against, slope) <= 0.0 {
            self.metric = Metric::identity();
            *slope
        } else {
            against
        };
        let length = dot(&against, &against).sqrt();
        // A step along slopes has no natural length; others are near 1.
        let longest = match self.way {
            Way::Metric => (4.0 * self.reach / length).min(1.0),
            Way::Steepest => self.reach / length,
            Way::Floor(_) => self.reach.max(self.near) / length,
        };
        (length > 0.0 && length.is_finite()).then(|| (against.map(|d| -d), longest))
    }

    /// Takes a step, or another way next time; false if there is none.
    fn step(&mut self, direction: &Vec6, longest: f64) -> bool {
        let length = dot(direction, direction).sqrt();
        let (pose, energy, slope) = self.at;
        let falls = dot(direction, &slope);
        let mut t = longest;
        while t * length >= self.descent.last_step {
            let step = direction.map(|d| t * d);
            let trial = self.descent.moved(&pose, &step);
            let trial = self.descent.at(self.source, trial, &mut self.scratch);
            self.met.push(trial.0, trial.2);
            if trial.1 <= energy + 1e-4 * t * falls {
                let change = std::array::from_fn(|i| trial.2[i] - slope[i]);
                self.metric.update(&step, &change);
                let [least, most] = [2.0 * self.descent.last_step, self.descent.first_step];
                self.reach = (2.0 * t * length).clamp(least, most);
                self.at = trial;
                self.way = match self.way {
                    Way::Floor(_) => Way::Floor(0),
                    _ => Way::Metric,
                };
                return true;
            }
            t *= 0.4;
        }
        self.metric = Metric::identity();
        self.way = match self.way {
            Way::Metric => Way::Steepest,
            Way::Steepest => Way::Floor(0),
            Way::Floor(looks) if looks < LOOKS => Way::Floor(looks + 1),
            Way::Floor(_) => return false,
        };
        true
    }
}

/// Approximation of the inverse second derivatives.
struct Metric([Vec6; 6]);

impl Metric {
    fn identity() -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| f64::from(i == j))
        }))
    }

    fn apply(&self, v: &Vec6) -> Vec6 {
        std::array::from_fn(|i| dot(&self.0[i], v))
    }

    /// The BFGS update for a step and the change of the gradient over it; skipped where the energy
    /// curves downwards.
    fn update(&mut self, step: &Vec6, change: &Vec6) {
        let curvature = dot(step, change);
        let floor = 1e-10 * (dot(step, step) * dot(change, change)).sqrt();
        if curvature <= floor {
            return;
        }
        let h = self.apply(change);
        let a = (1.0 + dot(change, &h) / curvature) / curvature;
        for i in 0..6 {
            for j in 0..6 {
                self.0[i][j] +=
                    a * step[i] * step[j] - (h[i] * step[j] + step[i] * h[j]) / curvature;
            }
        }
    }
}

/// Slopes that are remembered.
const MANY: usize = 24;

/// Steps towards the shortest mean of slopes.
const STEPS: usize = 1000;

/// Turn about the pivot times the radius, then displacement of the pivot, metres; or a slope along
/// these.
pub(super) type Vec6 = [f64; 6];

pub(super) fn dot(a: &Vec6, b: &Vec6) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The last slopes that were met.
#[derive(Default)]
pub(super) struct Slopes(VecDeque<(Pose, Vec6)>);

impl Slopes {
    pub(super) fn push(&mut self, at: Pose, slope: Vec6) {
        if self.0.len() == MANY {
            self.0.pop_front();
        }
        self.0.push_back((at, slope));
    }

    /// The shortest vector in the convex hull of those that are near, by moving weight from the one
    /// that is farthest ahead to the one farthest behind (Mitchell, Demyanov and Malozemov 1974).
    pub(super) fn shortest(&self, near: impl Fn(&Pose) -> bool) -> Vec6 {
        let near = self.0.iter().filter(|(p, _)| near(p));
        let slopes: Vec<&Vec6> = near.map(|(_, s)| s).collect();
        let Some((last, before)) = slopes.split_last() else {
            return [0.0; 6];
        };
        let mut weights = vec![0.0; before.len()];
        weights.push(1.0);
        let mut mean = **last;
        let mut along = vec![0.0; slopes.len()];
        for _ in 0..STEPS {
            for (a, s) in along.iter_mut().zip(&slopes) {
                *a = dot(s, &mean);
            }
            let by = |a: &usize, b: &usize| along[*a].total_cmp(&along[*b]);
            let held = (0..slopes.len()).filter(|i| weights[*i] > 0.0);
            let ends = [(0..slopes.len()).min_by(by), held.max_by(by)];
            let [Some(behind), Some(ahead)] = ends else {
                break;
            };
            let change: Vec6 = std::array::from_fn(|i| slopes[behind][i] - slopes[ahead][i]);
            let gain = along[ahead] - along[behind];
            if gain <= 1e-6 * dot(&mean, &mean) {
                break;
            }
            let share = (gain / dot(&change, &change)).min(weights[ahead]);
            weights[ahead] -= share;
            weights[behind] += share;
            mean = std::array::from_fn(|i| mean[i] + share * change[i]);
        }
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::Response;
    use crate::geometry::se3::Wrench;

    /// A valley about a known pose: quadratic, or V-shaped and rounded over a quarter of the first
    /// step, as a lattice rounds contact at zero clearance; with unequal stiffnesses.
    struct Valley {
        minimum: Pose,
        sharp: bool,
    }

    impl Valley {
        /// Gradient with respect to (turn about the origin, displacement).
        fn value(&self, pose: &Pose) -> (f64, DVec3) {
            let d = pose.translation - self.minimum.translation;
            let k = DVec3::new(1.0, 30.0, 5.0);
            if self.sharp {
                let round = (d * d + DVec3::splat(2.5e-3f64.powi(2))).map(f64::sqrt);
                ((k * round).element_sum(), k * d / round)
            } else {
                (0.5 * (k * d * d).element_sum(), k * d)
            }
        }
    }

    impl EnergySource for Valley {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let (energy, gradient) = self.value(pose);
            // Turning towards the minimum: E = 1 - cos of the angle between the z axes and x axes.
            let axes = [DVec3::X, DVec3::Z];
            let mut torque = DVec3::ZERO;
            let mut tilt = 0.0;
            for axis in axes {
                let (a, b) = (pose.rotation * axis, self.minimum.rotation * axis);
                tilt += 0.01 * (1.0 - a.dot(b));
                torque += 0.01 * a.cross(b);
            }
            Response {
                energy: energy + tilt,
                wrench: Wrench {
                    torque,
                    force: -gradient,
                },
                coverage: 1.0,
            }
        }
    }

    /// A floor along a slanting direction between walls that meet in an edge.
    struct Flush(DQuat);

    impl EnergySource for Flush {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let d = self.0.inverse() * pose.translation;
            let turn = pose.rotation.to_scaled_axis();
            let force = -DVec3::new(30.0 * d.x.signum(), 20.0 * d.y.signum(), 40.0 * d.z);
            Response {
                energy: 30.0 * d.x.abs() + 20.0 * d.y.abs() + 20.0 * d.z * d.z + turn.length(),
                wrench: Wrench {
                    torque: -turn.normalize_or_zero(),
                    force: self.0 * force,
                },
                coverage: 1.0,
            }
        }
    }

    /// As where walls are exactly flush: the floor falls by a thousandth of what its walls do.
    #[test]
    fn goes_on_along_the_floor_of_a_valley() {
        for turn in [
            DVec3::ZERO,
            DVec3::new(0.4, -0.9, 0.3),
            DVec3::new(1.3, 0.2, -2.0),
        ] {
            let source = Flush(DQuat::from_scaled_axis(turn));
            let descent = Descent {
                pivot: DVec3::ZERO,
                radius: 0.01,
                first_step: 1e-3,
                last_step: 5e-6,
                max_steps: 60,
            };
            let at = source.0 * DVec3::new(2e-4, -3e-4, 1.5e-3);
            let start = Pose::new(DQuat::from_rotation_y(0.01), at);
            let (pose, _) = descent.run(&source, &start);
            let off = source.0.inverse() * pose.translation;
            assert!(off.length() < 1e-4, "{turn}: {off}");
        }
    }

    #[test]
    fn finds_the_bottom_of_smooth_and_sharp_valleys() {
        let minimum = Pose::new(
            DQuat::from_scaled_axis(DVec3::new(0.2, -0.1, 0.3)),
            DVec3::new(0.01, 0.02, -0.01),
        );
        for (sharp, tolerance) in [(false, 1e-4), (true, 1e-4)] {
            let descent = Descent {
                pivot: DVec3::new(0.0, 0.05, 0.0),
                radius: 0.1,
                first_step: 0.01,
                last_step: 1e-7,
                max_steps: 400,
            };
            let source = Valley { minimum, sharp };
            let start = Pose::IDENTITY;
            let before = source.evaluate(&start, &mut Scratch::default()).energy;
            let (pose, energy) = descent.run(&source, &start);
            assert!(energy < before);
            let off = (pose.translation - minimum.translation).length();
            assert!(off < tolerance, "sharp {sharp}: {off} m");
            let angle = pose.angle_to(&minimum);
            assert!(angle < 10.0 * tolerance, "sharp {sharp}: {angle} rad");
        }
    }

    fn shortest(slopes: &[[f64; 3]]) -> [f64; 3] {
        let mut met = Slopes::default();
        for [x, y, z] in slopes {
            met.push(Pose::IDENTITY, [0.0, *x, 0.0, *y, 0.0, *z]);
        }
        let [_, x, _, y, _, z] = met.shortest(|_| true);
        [x, y, z]
    }

    /// Against what is plain to see: of two, of four walls, and of some that hold one another.
    #[test]
    fn the_shortest_mean_is_found() {
        let near = |a: [f64; 3], b: [f64; 3]| {
            let off: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
            off.sqrt() < 1e-3
        };
        assert!(near(shortest(&[[3.0, 4.0, 0.0]]), [3.0, 4.0, 0.0]));
        assert!(near(
            shortest(&[[1.0, 2.0, 0.0], [-1.0, 2.0, 0.0]]),
            [0.0, 2.0, 0.0]
        ));
        assert!(near(
            shortest(&[[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]]),
            [1.0, 2.0, 0.0]
        ));
        let walls = [[30.0, 20.0], [-30.0, 20.0], [30.0, -20.0], [-30.0, -20.0]];
        let floor = walls.map(|[x, y]| [x, y, 0.01]);
        assert!(
            near(shortest(&floor), [0.0, 0.0, 0.01]),
            "{:?}",
            shortest(&floor)
        );
        let held = [
            [30.0, 20.0, -1.0],
            [-30.0, 20.0, 2.0],
            [0.0, -50.0, 0.5],
            [1.0, 0.0, -3.0],
        ];
        assert!(near(shortest(&held), [0.0; 3]), "{:?}", shortest(&held));
        assert_eq!(shortest(&[]), [0.0; 3]);
    }

    #[test]
    fn the_oldest_are_forgotten_and_the_far_left_out() {
        let mut met = Slopes::default();
        met.push(Pose::IDENTITY, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for _ in 0..MANY {
            met.push(Pose::IDENTITY, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        assert_eq!(met.0.len(), MANY);
        assert_eq!(met.shortest(|_| true)[0], 2.0);
        assert_eq!(met.shortest(|_| false), [0.0; 6]);
    }
}
