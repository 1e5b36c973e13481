//! Poses from which a part is seated beside others: its places on single ones, turned and drawn out
//! where the joint there allows it.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};

/// A part that may slide is drawn out by these shares of the smaller one's length.
const DRAWN_OUT: [f64; 4] = [-0.5, -0.2, 0.2, 0.5];

/// Poses that are drawn out come after places that rank lower by less than this, nats.
const ALTERED: f64 = 6.0;

/// Axes are parallel whose directions have a cross product below this.
const PARALLEL: f64 = 0.02;

/// A pose to begin at.
#[derive(Debug, Clone)]
pub(crate) struct Seed {
    pub(crate) pose: Pose,
    /// How well one other part holds it there, nats.
    pub(crate) rank: f64,
    /// Point and direction of the axis about which the part may turn, or along which it may slide.
    pub(crate) axis: Option<(DVec3, DVec3)>,
    /// How long the smaller of both parts is along the axis, metres.
    pub(crate) length: f64,
}

impl Seed {
    /// Carried by a motion.
    pub(crate) fn moved(&self, motion: &Pose) -> Self {
        let carried = |(point, direction)| (motion.apply(point), motion.rotation * direction);
        Self {
            pose: *motion * self.pose,
            axis: self.axis.map(carried),
            ..self.clone()
        }
    }

    /// The pose itself; turned so that axes of the part (its frame) come to lie on axes of the others,
    /// as holes over bolts, up to `near` metres; and each of these drawn out along the axis.
    pub(crate) fn altered(
        &self,
        own: &[(DVec3, DVec3)],
        others: &[(DVec3, DVec3)],
        near: f64,
    ) -> Vec<(Pose, f64)> {
        let mut found = vec![(self.pose, self.rank)];
        let Some((point, direction)) = self.axis else {
            return found;
        };
        let lower = self.rank - ALTERED;
        // From the axis to a parallel one.
        let arm = |(p, d): (DVec3, DVec3)| {
            let parallel = d.cross(direction).length() < PARALLEL;
            let arm = (p - point).reject_from_normalized(direction);
            (parallel && arm.length() > 2.0 * near).then_some(arm)
        };
        let carried = |(p, d): &(DVec3, DVec3)| (self.pose.apply(*p), self.pose.rotation * *d);
        let mut angles: Vec<f64> = Vec::new();
        for a in own.iter().map(carried).filter_map(arm) {
            for b in others.iter().copied().filter_map(arm) {
                let angle = a.cross(b).dot(direction).atan2(a.dot(b));
                let known = |other: &f64| (angle - other).abs() * a.length() < near;
                if (a.length() - b.length()).abs() < near && !angles.iter().any(known) {
                    angles.push(angle);
                }
            }
        }
        for angle in angles {
            let turn = DQuat::from_axis_angle(direction, angle);
            let turned = Pose::new(turn, point - turn * point) * self.pose;
            found.push((turned, self.rank));
        }
        let drawn = found.iter().flat_map(|(pose, _)| {
            DRAWN_OUT.map(|share| {
                let shift = Pose::from_translation(share * self.length * direction);
                (shift * *pose, lower)
            })
        });
        let drawn: Vec<(Pose, f64)> = drawn.collect();
        found.extend(drawn);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate on one of two bolts is turned so that its other hole lies over the other bolt.
    #[test]
    fn the_other_hole_comes_over_the_other_bolt() {
        let bolts = [(DVec3::ZERO, DVec3::Z), (0.04 * DVec3::Y, -DVec3::Z)];
        let holes = [(DVec3::ZERO, DVec3::Z), (0.04 * DVec3::X, DVec3::Z)];
        let seed = Seed {
            pose: Pose::IDENTITY,
            rank: 20.0,
            axis: Some(bolts[0]),
            length: 0.01,
        };
        let poses = seed.altered(&holes, &bolts, 1e-3);
        let over = |p: &Pose| p.apply(holes[1].0).distance(bolts[1].0) < 1e-9;
        assert!(poses.iter().any(|(pose, rank)| over(pose) && *rank == 20.0));
        // As it is, and turned; each drawn out four times.
        assert_eq!(poses.len(), 10);
        let free = Seed { axis: None, ..seed };
        assert_eq!(free.altered(&holes, &bolts, 1e-3).len(), 1);
    }
}
