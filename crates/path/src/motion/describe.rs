//! Description of motions: pushes, turns and screws.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use fft_correlate::Pose;
use glam::DVec3;
use serde::Serialize;

use crate::motion::frame::{Frame, shift};
use crate::motion::vec6::Vec6;

/// A turn that moves points by less than this share of the translation beside it is not reported.
const NOTHING: f64 = 0.2;
/// The advance of a turn of less than [`ONE_TURN`] radians is not reported if it is less than this share
/// of the part's radius.
const PLAY: f64 = 0.03;
const ONE_TURN: f64 = 4.0;
/// Directions closer than this (radians) are one.
const SAME_DIRECTION: f64 = 0.1;
/// Axes of turns closer than this share of the part's radius are one.
const SAME_PLACE: f64 = 0.1;
/// Motions shorter than this share of the part's radius, and of the whole path, are not reported.
const SHORT: f64 = 0.05;

/// A motion along an axis, about it, or both: a straight one, a turn, or a screw. Vectors are along
/// the axes of the fixed part's frame, or of the frame that [`Motion::placed`] put it in.
///
/// ```
/// use std::f64::consts::TAU;
///
/// use pegfit_path::Motion;
///
/// // Three turns of a right-handed thread of 2 mm, inwards along -z.
/// let screw = Motion {
///     axis: [0.0, 0.0, -1.0],
///     point: [0.0; 3],
///     turn: 3.0 * TAU,
///     advance: 0.006,
///     length: 0.1,
/// };
/// assert!((screw.pitch().expect("it turns") - 0.002).abs() < 1e-12);
/// assert!(screw.to_string().starts_with("screw, 3.00 turns"));
/// // Out again it turns the other way.
/// assert_eq!(screw.reversed().axis, [0.0, 0.0, 1.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Motion {
    /// Direction of the axis, a unit vector: that of a straight motion, or such that the part turns
    /// counter-clockwise about it.
    pub axis: [f64; 3],
    /// The point of the axis that is closest to the part's centre at the outset, metres; where the
    /// centre is if there is no turn.
    pub point: [f64; 3],
    /// Rotation angle, radians, 0 or more.
    pub turn: f64,
    /// How far it goes along the axis, metres; negative against it.
    pub advance: f64,
    /// Path length of the point of the part that goes farthest, metres.
    pub length: f64,
}

impl Motion {
    /// Advance per full turn, metres: positive of a right-handed screw. None if nothing turns.
    pub fn pitch(&self) -> Option<f64> {
        (self.turn > 0.0).then(|| TAU * self.advance / self.turn)
    }

    /// The motion back.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let axis = DVec3::from_array(self.axis);
        Self {
            axis: (-axis).to_array(),
            point: (DVec3::from_array(self.point) + self.advance * axis).to_array(),
            ..*self
        }
    }

    /// The same motion as seen from where `by` puts the fixed frame.
    #[must_use]
    pub fn placed(&self, by: &Pose) -> Self {
        Self {
            axis: (by.rotation * DVec3::from_array(self.axis)).to_array(),
            point: by.apply(DVec3::from_array(self.point)).to_array(),
            ..*self
        }
    }

    /// A screw motion from a pose, as frames know it.
    fn from_step(frame: &Frame, pose: &Pose, motion: &Vec6) -> Self {
        let (turn, moved) = (frame.turn(motion), shift(motion));
        let centre = pose.apply(frame.centre);
        let length = frame.largest(pose, motion);
        let (angle, distance) = (turn.length(), moved.length());
        if angle * frame.radius <= NOTHING * distance || angle == 0.0 {
            return Self {
                axis: moved.normalize_or_zero().to_array(),
                point: centre.to_array(),
                turn: 0.0,
                advance: distance,
                length,
            };
        }
        let axis = turn / angle;
        let advance = moved.dot(axis);
        Self {
            axis: axis.to_array(),
            point: (centre + turn.cross(moved) / angle.powi(2)).to_array(),
            turn: angle,
            advance,
            length,
        }
    }

    /// Both motions as one, where they are about one axis.
    fn joined(&self, next: &Self, radius: f64) -> Option<Self> {
        let [a, b] = [self, next].map(|m| DVec3::from_array(m.axis));
        let straight = [self, next].map(|m| m.turn == 0.0);
        if straight[0] != straight[1] || a.angle_between(b) > SAME_DIRECTION {
            return None;
        }
        let between = DVec3::from_array(next.point) - DVec3::from_array(self.point);
        if !straight[0] {
            let apart = (between - between.dot(a) * a).length();
            let slopes = [self, next].map(|m| m.advance / m.turn);
            let differ = (slopes[0] - slopes[1]).abs() > SAME_PLACE * radius / TAU;
            if apart > SAME_PLACE * radius || differ {
                return None;
            }
        }
        let axis = (a * self.length + b * next.length).normalize();
        Some(Self {
            axis: axis.to_array(),
            point: self.point,
            turn: self.turn + next.turn,
            advance: self.advance + next.advance,
            length: self.length + next.length,
        })
    }

    /// A turn with no more advance than its play allows is a turn.
    fn rounded(self, radius: f64) -> Self {
        let within_play = self.turn < ONE_TURN && self.advance.abs() < PLAY * radius;
        match self.turn > 0.0 && (within_play || self.advance.abs() < 1e-3 * self.turn * radius) {
            true => Self {
                advance: 0.0,
                ..self
            },
            false => self,
        }
    }

    fn describe_angle(&self) -> String {
        let near = |angle: f64| (self.turn - angle).abs() < 0.05 * angle;
        let known = [
            (FRAC_PI_2, "quarter turn"),
            (PI, "half turn"),
            (TAU, "full turn"),
        ];
        match known.iter().find(|k| near(k.0)) {
            Some((_, words)) => (*words).to_owned(),
            None if self.turn > 1.2 * TAU => format!("{:.2} turns", self.turn / TAU),
            None => format!("turn by {:.0} degrees", self.turn.to_degrees()),
        }
    }
}

impl fmt::Display for Motion {
    /// `push 12.0 mm along (0.00, 0.00, -1.00)`, `quarter turn about (0.00, 0.00, 1.00)`,
    /// `screw 3.50 turns about (0.00, 0.00, 1.00), pitch 2.00 mm, right-handed`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // No minus before a zero.
        let [x, y, z] = self.axis.map(|c| (c * 100.0).round() / 100.0 + 0.0);
        let axis = format!("({x:.2}, {y:.2}, {z:.2})");
        let along = 1e3 * self.advance.abs();
        match self.pitch() {
            None => write!(f, "push {along:.1} mm along {axis}"),
            Some(0.0) => write!(f, "{} about {axis}", self.describe_angle()),
            Some(pitch) => {
                let hand = if pitch > 0.0 { "right" } else { "left" };
                let pitch = 1e3 * pitch.abs();
                let angle = self.describe_angle();
                write!(
                    f,
                    "screw, {angle} about {axis}, pitch {pitch:.2} mm, {hand}-handed"
                )
            }
        }
    }
}

/// The motions that lead from each pose to the next, those about one axis as one; short ones are left
/// out.
pub(crate) fn describe_motions(frame: &Frame, poses: &[Pose]) -> Vec<Motion> {
    let steps = poses.windows(2);
    let each: Vec<Motion> = steps
        .map(|w| Motion::from_step(frame, &w[0], &frame.between(&w[0], &w[1])))
        .collect();
    let whole: f64 = each.iter().map(|m| m.length).sum();
    let short = SHORT * frame.radius.min(whole);
    let mut described: Vec<Motion> = Vec::new();
    for motion in each.into_iter().filter(|m| m.length > short) {
        let joined = described
            .last()
            .and_then(|last| last.joined(&motion, frame.radius));
        match joined {
            Some(both) => *described.last_mut().expect("joined to it") = both,
            None => described.push(motion),
        }
    }
    described
        .into_iter()
        .map(|m| m.rounded(frame.radius))
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use sdf_grid::shapes;

    use super::*;

    #[test]
    fn pushes_turns_and_screws_are_described_apart() {
        let mesh = shapes::cuboid(DVec3::new(0.01, 0.01, 0.03)).unwrap();
        let frame = Frame::new(mesh.centroid(), mesh.vertices());
        let along = |z: f64| Pose::from_translation(DVec3::Z * z);
        let about = |turn: f64, z: f64| Pose::new(DQuat::from_rotation_z(turn), DVec3::Z * z);
        let mut poses = vec![along(0.03), along(0.02), along(0.01)];
        poses.push(about(1.0, 0.01));
        poses.push(about(FRAC_PI_2, 0.01));
        poses.push(about(FRAC_PI_2, 0.0));
        let words: Vec<String> = describe_motions(&frame, &poses)
            .iter()
            .map(Motion::to_string)
            .collect();
        assert_eq!(
            words,
            [
                "push 20.0 mm along (0.00, 0.00, -1.00)",
                "quarter turn about (0.00, 0.00, 1.00)",
                "push 10.0 mm along (0.00, 0.00, -1.00)"
            ]
        );
        let place = Pose::new(DQuat::from_rotation_x(0.4), DVec3::splat(0.01));
        for pitch in [0.002, -0.0007] {
            let screw = |i: i32| {
                let turn = 2.0 * f64::from(i);
                place * about(turn, pitch * turn / TAU) * place.inverse()
            };
            let poses: Vec<Pose> = (0..6).map(screw).collect();
            let found = describe_motions(&frame, &poses);
            assert_eq!(found.len(), 1);
            assert!((found[0].pitch().unwrap() - pitch).abs() < 1e-9);
            assert!((found[0].turn - 10.0).abs() < 1e-9);
            let axis = DVec3::from_array(found[0].placed(&place.inverse()).axis);
            assert!(axis.angle_between(DVec3::Z) < 1e-9);
        }
    }
}
