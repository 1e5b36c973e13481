//! Rotations outside a ball, read where the ball ends.

use glam::{DQuat, DVec3};

/// How a rotation outside a ball moves where it is read: towards the centre about the axis that
/// leads there, so that the radial slope comes to rest just outside.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rest {
    axis: DVec3,
    /// Angle by which the rotation is turned, about the axis.
    turn: f64,
    /// What a turn about the axis becomes, per radian.
    along: f64,
    /// What a turn across the axis becomes, before it is turned by half of `turn`.
    across: f64,
}

impl Rest {
    /// For a rotation `r` from the ball's centre (`r.w >= 0`) by an angle of `found`, greater than
    /// the ball's `angle`; the slope comes to rest over `margin`. Radians.
    pub(crate) fn new(r: DQuat, found: f64, angle: f64, margin: f64) -> Self {
        let rest = (1.0 - (found - angle) / margin).max(0.0);
        let read = angle + 0.25 * margin * (1.0 - rest.powi(4));
        Self {
            axis: r.xyz() / r.xyz().length().max(1e-300),
            turn: read - found,
            along: rest.powi(3),
            across: (0.5 * read).sin() / (0.5 * found).sin().max(1e-300),
        }
    }

    /// Where `q`, the rotation it was made for, is read.
    pub(crate) fn apply(&self, q: DQuat) -> DQuat {
        (DQuat::from_axis_angle(self.axis, self.turn) * q).normalize()
    }

    /// A torque where it is read as one at the rotation itself. With `q = exp(a n) c` a change of
    /// `n` is a turn by `2 sin(a/2) R(n, a/2) dn`.
    pub(crate) fn pull_back(&self, torque: DVec3) -> DVec3 {
        let along = self.axis.dot(torque) * self.axis;
        let back = DQuat::from_axis_angle(self.axis, -0.5 * self.turn);
        self.along * along + self.across * (back * (torque - along))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a linear function of the read rotation's entries, by central differences.
    #[test]
    fn torques_are_pulled_back_by_the_derivative() {
        let center = DQuat::from_xyzw(0.3, -0.2, 0.5, 0.7).normalize();
        let (angle, margin) = (0.4, 0.3);
        let read = |q: DQuat| {
            let r = q * center.conjugate();
            let r = if r.w < 0.0 { -r } else { r };
            let found = 2.0 * r.xyz().length().atan2(r.w);
            let rest = Rest::new(r, found, angle, margin);
            (rest.apply(q), rest)
        };
        let probe = DVec3::new(0.4, -0.7, 0.2);
        for (axis, by) in [
            (DVec3::new(1.0, 2.0, -0.5), 0.45),
            (DVec3::new(-0.3, 0.1, 0.9), 0.65),
            (DVec3::new(0.2, -1.0, 0.4), 1.9),
        ] {
            let q = DQuat::from_axis_angle(axis.normalize(), by) * center;
            let value = |q: DQuat| (read(q).0 * DVec3::X).dot(probe);
            let (at, rest) = read(q);
            // d(R x) = w x (R x)
            let torque = (at * DVec3::X).cross(probe);
            let found = rest.pull_back(torque);
            for e in [DVec3::X, DVec3::Y, DVec3::Z] {
                let moved = |h: f64| value(DQuat::from_scaled_axis(h * e) * q);
                let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((slope - found.dot(e)).abs() < 1e-8, "{slope} {found}");
            }
            assert!((at * center.conjugate()).w.acos() * 2.0 < angle + 0.25 * margin + 1e-9);
        }
    }
}
