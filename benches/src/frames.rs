//! Both parts turned and shifted together: what no answer should depend on, and lattices do.

use fft_correlate::{Pair, Pose, Response, Wrench};
use glam::{DQuat, DVec3};
use sdf_grid::TriangleMesh;

/// A motion of both parts.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Where both parts go.
    pub motion: Pose,
}

impl Frame {
    /// As they are.
    pub const OWN: Self = Self {
        motion: Pose::IDENTITY,
    };

    /// Shifted by fractions of any cell, millimetres across.
    pub fn shifted() -> Self {
        let motion = Pose::from_translation(DVec3::new(3.1e-4, 1.7e-4, -4.3e-4));
        Self { motion }
    }

    /// Turned about no axis of the parts, and shifted.
    pub fn turned() -> Self {
        let turn = DQuat::from_xyzw(0.2, 0.4, 0.4, 0.8);
        let motion = Pose::new(turn.normalize(), DVec3::new(3.1e-3, -1.7e-3, 2.3e-3));
        Self { motion }
    }

    /// A part there.
    #[must_use]
    pub fn part(&self, mesh: &TriangleMesh) -> TriangleMesh {
        mesh.transformed(self.motion.rotation, self.motion.translation)
    }

    /// The pose of the moved parts that is `pose` of the parts as they were.
    #[must_use]
    pub fn pose(&self, pose: &Pose) -> Pose {
        self.motion * *pose * self.motion.inverse()
    }

    /// The response of the moved parts at the moved pose `there`, as that of the parts as they were.
    #[must_use]
    pub fn back(&self, response: &Response, there: &Pose) -> Response {
        // The origin of the moving part, as it was, lies at this offset from the new one.
        let arm = there.rotation * self.motion.translation;
        let wrench = response.wrench.about(arm);
        let turn = self.motion.rotation.conjugate();
        Response {
            wrench: Wrench {
                torque: turn * wrench.torque,
                force: turn * wrench.force,
            },
            ..*response
        }
    }
}

/// Sliding in along a wall, pressing from wall to wall, and turning in the hole: `count` poses of
/// each, never with walls exactly flush, the pivot displaced by up to `reach` metres, turned by up to `angle` radians.
pub fn contact_paths(pair: &Pair, angle: f64, reach: f64, count: usize) -> Vec<Pose> {
    let at = |k: usize| k as f64 / (count - 1) as f64;
    let slide = (0..count).map(|k| {
        let tilt = DQuat::from_rotation_y(0.01);
        pair.pose(tilt, DVec3::new(2.9e-4, 0.13e-4, reach * (1.0 - at(k))))
    });
    let press = (0..count).map(|k| {
        let across = reach * (at(k) - 0.5);
        pair.pose(DQuat::IDENTITY, DVec3::new(across, 1.37e-4, 2.3e-4))
    });
    let spin = (0..count).map(|k| {
        let turn = DQuat::from_rotation_z(angle * (2.0 * at(k) - 1.0));
        pair.pose(turn, DVec3::new(2.1e-4, -1.13e-4, 3.3e-4))
    });
    slide.chain(press).chain(spin).collect()
}
