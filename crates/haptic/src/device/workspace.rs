//! Where the device's workspace lies in the scene.

use fft_correlate::{Pose, Wrench};
use glam::{DQuat, DVec3};

/// The map from the device's frame to the scene's, and the point at which the handle holds the
/// moving part.
///
/// The *grip pose* is the pose of the moving part with its origin moved to the grip: same
/// rotation, translation `pose.apply(grip)`. Torques in the loop are about the grip.
///
/// ```
/// use fft_correlate::{Pose, Wrench};
/// use glam::DVec3;
/// use haptic::Workspace;
///
/// // Half a scene millimetre per millimetre of the device.
/// let workspace = Workspace::new(0.5, Pose::IDENTITY, DVec3::ZERO);
/// let device = Pose::from_translation(DVec3::X * 0.01);
/// let grip = workspace.grip_pose(&device);
/// assert_eq!(grip.translation, DVec3::X * 0.005);
/// assert_eq!(workspace.device_pose(&workspace.part_pose(&grip)), device);
/// // Forces scale with it, so that power is the same on both sides.
/// let wrench = Wrench { force: DVec3::X * 4.0, ..Wrench::ZERO };
/// assert_eq!(workspace.device_wrench(&wrench).force, DVec3::X * 2.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    /// Scene metres per device metre.
    pub scale: f64,
    /// Turns device axes into scene axes.
    pub axes: DQuat,
    /// The part's pose while the device is at its origin, unturned.
    pub home: Pose,
    /// Point of the moving part (metres, its frame) that the handle holds and turns about.
    pub grip: DVec3,
}

impl Workspace {
    /// Device and scene axes alike.
    pub fn new(scale: f64, home: Pose, grip: DVec3) -> Self {
        Self {
            scale,
            axes: DQuat::IDENTITY,
            home,
            grip,
        }
    }

    /// Grip pose in the scene of a handle pose in the device's frame.
    pub fn grip_pose(&self, device: &Pose) -> Pose {
        let turn = self.axes * device.rotation * self.axes.conjugate();
        Pose {
            rotation: (turn * self.home.rotation).normalize(),
            translation: self.home.apply(self.grip) + self.scale * (self.axes * device.translation),
        }
    }

    /// Handle pose in the device's frame of a pose of the moving part: the inverse of
    /// [`Workspace::grip_pose`] followed by [`Workspace::part_pose`].
    pub fn device_pose(&self, part: &Pose) -> Pose {
        let turn = part.rotation * self.home.rotation.conjugate();
        let offset = part.apply(self.grip) - self.home.apply(self.grip);
        Pose {
            rotation: (self.axes.conjugate() * turn * self.axes).normalize(),
            translation: self.axes.conjugate() * offset / self.scale,
        }
    }

    /// Pose of the moving part from its grip pose.
    pub fn part_pose(&self, grip_pose: &Pose) -> Pose {
        Pose {
            rotation: grip_pose.rotation,
            translation: grip_pose.translation - grip_pose.rotation * self.grip,
        }
    }

    /// Moves a wrench about the part's origin to the grip, both in the scene's frame.
    pub fn grip_wrench(&self, grip_pose: &Pose, wrench: &Wrench) -> Wrench {
        wrench.about(grip_pose.rotation * self.grip)
    }

    /// Turns a wrench on the grip (scene) into the wrench on the handle (device) that has the same
    /// power.
    pub fn device_wrench(&self, wrench: &Wrench) -> Wrench {
        Wrench {
            torque: self.axes.conjugate() * wrench.torque,
            force: self.axes.conjugate() * wrench.force * self.scale,
        }
    }

    /// The inverse of [`Workspace::device_wrench`].
    pub fn scene_wrench(&self, wrench: &Wrench) -> Wrench {
        Wrench {
            torque: self.axes * wrench.torque,
            force: self.axes * wrench.force / self.scale,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fft_correlate::Twist;

    fn sample() -> Workspace {
        Workspace {
            scale: 0.3,
            axes: DQuat::from_rotation_x(0.4),
            home: Pose::new(DQuat::from_rotation_y(0.2), DVec3::new(0.1, 0.2, 0.3)),
            grip: DVec3::new(0.01, -0.02, 0.05),
        }
    }

    #[test]
    fn poses_go_there_and_back() {
        let workspace = sample();
        let device = Pose::new(DQuat::from_rotation_z(0.7), DVec3::new(0.05, 0.01, -0.04));
        let part = workspace.part_pose(&workspace.grip_pose(&device));
        let back = workspace.device_pose(&part);
        assert!(back.angle_to(&device) < 1e-7); // acos near 1 keeps half the digits
        assert!((back.translation - device.translation).length() < 1e-15);
        assert_eq!(
            workspace.device_pose(&workspace.home).translation,
            DVec3::ZERO
        );
    }

    #[test]
    fn power_is_the_same_on_both_sides() {
        let workspace = sample();
        let wrench = Wrench {
            torque: DVec3::new(0.1, -0.2, 0.3),
            force: DVec3::new(3.0, 1.0, -2.0),
        };
        let step = Twist {
            angular: DVec3::new(1e-6, 2e-6, -1e-6),
            linear: DVec3::new(-2e-6, 1e-6, 3e-6),
        };
        let device = Pose::new(DQuat::from_rotation_z(0.7), DVec3::new(0.05, 0.01, -0.04));
        let before = workspace.grip_pose(&device);
        let after = workspace.grip_pose(&device.perturbed(&step));
        // Work on the part itself, torque about its own origin, against the handle's work.
        let part = workspace
            .part_pose(&before)
            .twist_to(&workspace.part_pose(&after));
        let work = wrench.dot(&part);
        let at_grip = workspace.grip_wrench(&before, &wrench);
        assert!((at_grip.dot(&before.twist_to(&after)) - work).abs() < 1e-9 * work.abs() + 1e-11);
        let felt = workspace.device_wrench(&at_grip);
        assert!((felt.dot(&step) - work).abs() < 1e-5 * work.abs() + 1e-11);
        let back = workspace.scene_wrench(&felt);
        assert!((back - at_grip).force.length() < 1e-14);
    }
}
