//! Seating: small motions that bring faces which nearly mate onto each other.

use glam::{DQuat, DVec3};
use sdf_grid::{Matrix6, Monitor, SurfacePoint};

use super::contact::MatingContact;
use crate::geometry::se3::Pose;

/// Steps at each clearance, at most.
const STEPS: usize = 3;

/// How samples are weighed.
#[derive(Debug, Clone, Copy)]
struct Weighing {
    /// Weight of a sample inside the other part against one outside.
    inside: f64,
    /// The weight falls by this power of the gap, clearances.
    power: i32,
}

/// While seating: the nearest face draws most.
const SEATING: Weighing = Weighing {
    inside: 3.0,
    power: 2,
};

/// In the middle of what play there is: faces on both sides count alike. A lower power would make
/// the middle of wide play unstable.
const EVEN: Weighing = Weighing {
    inside: 1.0,
    power: 8,
};

/// Nats by which a turn of a round part must hold it better to be taken.
const CLEARLY: f64 = 1.0;

/// Nats of hold that a part in the middle of its play may lose.
const MIDDLE: f64 = 0.5;

/// Holds motions in place that no sample speaks for.
const DAMPING: f64 = 1e-3;

/// Stiffness against motions that leave a known axis; the whole surface against a plane has 1.
const RIGID: f64 = 1e4;

/// A part leans by at most this, radians: 4 degrees.
const LEANING: f64 = 0.07;

/// Largest turn of a step, radians.
const LARGEST_TURN: f64 = 0.1;

/// Clearances in turn, shares of the coarse one: from afar, and for a pose that is nearly right.
const FROM_AFAR: [f64; 4] = [1.0, 0.6, 0.35, 0.2];
const NEARLY_RIGHT: [f64; 2] = [0.35, 0.15];

impl MatingContact {
    /// The pose near `start` where faces that mate there lie closest to each other, by Gauss and
    /// Newton's method on their gaps within ever smaller clearances: once from afar, once as if the
    /// start were nearly right. The best held one, the start if that is.
    pub fn seat(&self, start: &Pose) -> (Pose, f64) {
        let [many, few] = self.samples();
        let near = self.approach(many, start, &NEARLY_RIGHT);
        let far = self.approach(few, start, &FROM_AFAR);
        let far = self.approach(many, &far, &NEARLY_RIGHT);
        let near = (near, self.hold(&near).hold);
        self.better(self.better(near, far, 0.0), *start, 0.0)
    }

    /// A pose with its hold, or the other one if that holds the part better by more than `by`, nats.
    fn better(&self, held: (Pose, f64), other: Pose, by: f64) -> (Pose, f64) {
        match self.hold_above(&other, held.1 + by) {
            Some(hold) => (other, hold),
            None => held,
        }
    }

    /// The seat of a pose that is nearly right.
    pub(super) fn approach_nearly_right(&self, pose: &Pose) -> Pose {
        let [many, _] = self.samples();
        self.approach(many, pose, &NEARLY_RIGHT)
    }

    fn approach(&self, samples: &[SurfacePoint], start: &Pose, clearances: &[f64]) -> Pose {
        let mut pose = *start;
        for share in clearances {
            let clearance = share * 1.5 * self.clearance();
            for _ in 0..STEPS {
                let Some((turn, shift)) = self.step(samples, &pose, clearance, SEATING) else {
                    break;
                };
                pose = self.moved(&pose, turn, shift);
                if shift.length() + turn.length() * self.radius < 1e-3 * clearance {
                    break;
                }
            }
        }
        pose
    }

    /// A seated part that leans a little in its play, set straight: in the nearest of the rotations
    /// that make planes parallel, seated again, if that holds it better.
    pub(super) fn straightened(
        &self,
        (start, hold): (Pose, f64),
        rotations: &[DQuat],
    ) -> (Pose, f64) {
        let cosine = |q: &DQuat| q.dot(start.rotation).abs();
        let nearest = rotations
            .iter()
            .max_by(|a, b| cosine(a).total_cmp(&cosine(b)));
        let Some(q) = nearest.filter(|q| cosine(q) > (0.5 * LEANING).cos()) else {
            return (start, hold);
        };
        let middle = start.apply(self.centre);
        let straight = Pose::new(*q, middle - *q * self.centre);
        let straight = self.approach_nearly_right(&straight);
        self.better((start, hold), straight, 0.0)
    }

    /// A seated round part turned about its axis (its own frame) so that its facets lie best in those
    /// around them: the turn, of these (radians), that holds it best when it is seated again.
    pub(super) fn spun(
        &self,
        start: (Pose, f64),
        axis: Option<DVec3>,
        turns: &[f64],
    ) -> (Pose, f64) {
        let Some(axis) = axis else {
            return start;
        };
        let about = start.0.rotation * axis;
        turns.iter().fold(start, |best, turn| {
            let pose = self.moved(&start.0, *turn * about, DVec3::ZERO);
            self.better(best, self.approach_nearly_right(&pose), CLEARLY)
        })
    }

    /// The pose in the middle of the play around one, if that holds the part as well: faces on both
    /// sides within the clearance count, however close one of them is.
    pub(super) fn centred(&self, (start, hold): (Pose, f64)) -> (Pose, f64) {
        self.better((start, hold), self.middle(&start), -MIDDLE)
    }

    /// The pose in the middle of the play around one.
    pub(super) fn middle(&self, start: &Pose) -> Pose {
        let [many, _] = self.samples();
        let mut pose = *start;
        for _ in 0..2 * STEPS {
            let Some((turn, shift)) = self.step(many, &pose, self.clearance(), EVEN) else {
                break;
            };
            pose = self.moved(&pose, turn, shift);
        }
        pose
    }

    /// Turn (radians) and displacement (metres) that close the gaps within a clearance; none if there
    /// are none.
    fn step(
        &self,
        samples: &[SurfacePoint],
        pose: &Pose,
        clearance: f64,
        weighing: Weighing,
    ) -> Option<(DVec3, DVec3)> {
        let centre = pose.apply(self.centre);
        let (mut normal_matrix, mut right, mut count) = (Matrix6::default(), [0.0; 6], 0);
        self.visit_mating(samples, pose, clearance, |s, p, n, gap, face| {
            count += 1;
            let height = gap * -face.dot(n);
            let near = 1.0 - (gap / clearance).powi(weighing.power);
            let inside = if height < 0.0 { weighing.inside } else { 1.0 };
            let weight = s.weight * near * inside;
            let row = self.row(centre, p, face);
            normal_matrix.add_outer(weight, &row);
            for (sum, r) in right.iter_mut().zip(&row) {
                *sum -= weight * height * r;
            }
        });
        if count == 0 {
            return None;
        }
        if let Some(axis) = &self.known_axis {
            axis.stiffen(&mut normal_matrix, centre, self.radius, RIGID);
        }
        for i in 0..6 {
            normal_matrix.0[i][i] += DAMPING;
        }
        let step = normal_matrix.solve(&right);
        let turn = DVec3::new(step[3], step[4], step[5]) / self.radius;
        let shift = DVec3::new(step[0], step[1], step[2]);
        Some((
            turn.clamp_length_max(LARGEST_TURN),
            shift.clamp_length_max(clearance),
        ))
    }

    /// A pose turned about the moving part's centre, and shifted; on a known axis only about and
    /// along it.
    pub(super) fn moved(&self, pose: &Pose, turn: DVec3, shift: DVec3) -> Pose {
        if let Some(axis) = &self.known_axis {
            return axis.moved(pose, turn, shift);
        }
        let centre = pose.apply(self.centre) + shift;
        let rotation = (DQuat::from_scaled_axis(turn) * pose.rotation).normalize();
        Pose::new(rotation, centre - rotation * self.centre)
    }

    /// Moves a seated part along the motion that contact resists least, as long as that holds it
    /// better: a pin goes home, a slide to where most of it is guided. Returns pose and hold.
    pub(super) fn slide(
        &self,
        (mut pose, mut hold): (Pose, f64),
        monitor: &dyn Monitor,
    ) -> (Pose, f64) {
        /// Moves, at most; the longest one, coarse clearances.
        const MOVES: usize = 24;
        const LONGEST: f64 = 16.0;
        let mut stride = 4.0;
        for _ in 0..MOVES {
            if monitor.cancelled() {
                break;
            }
            let mut matrix = self.gramian(&pose, self.clearance()).matrix;
            if let Some(axis) = &self.known_axis {
                axis.stiffen(&mut matrix, pose.apply(self.centre), self.radius, RIGID);
            }
            let m = matrix.eigen().1[0];
            let (turn, shift) = (
                DVec3::new(m[3], m[4], m[5]) / self.radius,
                DVec3::new(m[0], m[1], m[2]),
            );
            let mut best = None;
            for sense in [1.0, -1.0] {
                let length = sense * stride * self.resolution;
                let there = self.moved(&pose, length * turn, length * shift);
                let there = self.approach_nearly_right(&there);
                let least = best.map_or(hold + 1e-3, |(_, hold)| hold);
                best = self
                    .hold_above(&there, least)
                    .map(|hold| (there, hold))
                    .or(best);
            }
            if let Some(better) = best {
                (pose, hold) = better;
                stride = (2.0 * stride).min(LONGEST);
            } else if stride > 0.3 {
                stride *= 0.4;
            } else {
                break;
            }
        }
        (pose, hold)
    }
}
