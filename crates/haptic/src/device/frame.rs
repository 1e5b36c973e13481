//! A maker's frame against ours: x right, y away from the user, z up.

use fft_correlate::{Pose, Twist};
use glam::{DQuat, DVec3};

/// Turns a maker's axes into ours. Rotations are turned along with them, so that a handle that is
/// unturned for the maker is unturned for us.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes(DQuat);

impl Axes {
    /// x right, y away from the user, z up: ours.
    pub(crate) const OURS: Self = Self(DQuat::IDENTITY);

    /// x right, y up, z towards the user: a quarter turn about x.
    pub(crate) const Y_UP: Self = Self(DQuat::from_xyzw(
        std::f64::consts::FRAC_1_SQRT_2,
        0.0,
        0.0,
        std::f64::consts::FRAC_1_SQRT_2,
    ));

    /// x towards the user, y right, z up: a quarter turn back about z.
    pub(crate) const X_TO_USER: Self = Self(DQuat::from_xyzw(
        0.0,
        0.0,
        -std::f64::consts::FRAC_1_SQRT_2,
        std::f64::consts::FRAC_1_SQRT_2,
    ));

    /// A maker's pose, metres, in our frame.
    pub(crate) fn pose(self, rotation: DQuat, translation: DVec3) -> Pose {
        Pose {
            rotation: (self.0 * rotation * self.0.conjugate()).normalize(),
            translation: self.0 * translation,
        }
    }

    /// A maker's velocities, rad/s and m/s, in our frame.
    pub(crate) fn twist(self, angular: DVec3, linear: DVec3) -> Twist {
        Twist {
            angular: self.0 * angular,
            linear: self.0 * linear,
        }
    }

    /// A vector of ours, a force or a torque, in the maker's frame.
    pub(crate) fn to_maker(self, vector: DVec3) -> DVec3 {
        self.0.conjugate() * vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_go_where_they_are_said_to() {
        let (right, away, up) = (DVec3::X, DVec3::Y, DVec3::Z);
        for (axes, x, y, z) in [
            (Axes::OURS, right, away, up),
            (Axes::Y_UP, right, up, -away),
            (Axes::X_TO_USER, -away, right, up),
        ] {
            for (theirs, ours) in [(DVec3::X, x), (DVec3::Y, y), (DVec3::Z, z)] {
                let moved = axes.pose(DQuat::IDENTITY, theirs).translation;
                assert!((moved - ours).length() < 1e-15, "{axes:?} {theirs}");
                assert!((axes.to_maker(ours) - theirs).length() < 1e-15);
                // A turn about one of their axes is the same turn about ours.
                let turned = axes.pose(DQuat::from_axis_angle(theirs, 0.3), DVec3::ZERO);
                let expected = DQuat::from_axis_angle(ours, 0.3);
                assert!(turned.rotation.angle_between(expected) < 1e-7);
            }
        }
    }
}
