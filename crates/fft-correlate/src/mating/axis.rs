//! A known axis: the moving part turns about it and slides along it, and moves in no other way.

use glam::{DQuat, DVec3};
use sdf_grid::{Matrix6, PatchAxis, Vector6};

use crate::geometry::se3::Pose;

/// Sine of the angle by which an axis of a part on the known axis may lean.
pub(super) const LEANS: f64 = 1e-3;

/// A line of the fixed frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct KnownAxis {
    pub(super) point: DVec3,
    direction: DVec3,
}

impl KnownAxis {
    /// Through a point (metres); the direction may have any length but zero.
    pub(super) fn new((point, direction): (DVec3, DVec3)) -> Self {
        let direction = direction.normalize();
        Self { point, direction }
    }

    /// Adds a stiffness against all motions that leave the axis to a matrix of displacements of
    /// `centre` and of turns about it times `radius`, both in metres.
    pub(super) fn stiffen(&self, matrix: &mut Matrix6, centre: DVec3, radius: f64, stiffness: f64) {
        let row = |shift: DVec3, turn: DVec3| {
            let turn = radius * turn;
            [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
        };
        let slide = row(self.direction, DVec3::ZERO);
        // Orthogonal to the slide.
        let turn = row(self.direction.cross(centre - self.point), self.direction);
        let square = |v: &Vector6| v.iter().map(|x| x * x).sum::<f64>();
        for i in 0..6 {
            matrix.0[i][i] += stiffness;
        }
        for motion in [slide, turn] {
            matrix.add_outer(-stiffness / square(&motion), &motion);
        }
    }

    /// A pose after the part of a displacement along the axis, and of a turn (radians) about it.
    pub(super) fn moved(&self, pose: &Pose, turn: DVec3, shift: DVec3) -> Pose {
        let turn = DQuat::from_axis_angle(self.direction, turn.dot(self.direction));
        let translation = self.point + turn * (pose.translation - self.point);
        Pose::new(
            (turn * pose.rotation).normalize(),
            translation + shift.dot(self.direction) * self.direction,
        )
    }

    /// Whether one of a part's axes (its frame) lies on this one at a pose, up to the sine of an angle and
    /// a distance, metres.
    pub(super) fn carries(
        &self,
        pose: &Pose,
        axes: &[PatchAxis],
        (sine, distance): (f64, f64),
    ) -> bool {
        axes.iter().any(|axis| {
            let direction = pose.rotation * axis.direction;
            let beside = (pose.apply(axis.point) - self.point).cross(self.direction);
            direction.cross(self.direction).length() < sine && beside.length() < distance
        })
    }
}
