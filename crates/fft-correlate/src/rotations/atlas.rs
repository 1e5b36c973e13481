//! Charts over a set of rotations, their images under a symmetry, and the seams that join them.
//! Rotations outside a ball are read where the ball ends.

use std::f64::consts::FRAC_PI_4;

use glam::{DQuat, DVec3};

use crate::geometry::taps::fade;
use crate::rotations::chart::Chart;
use crate::rotations::symmetry::Symmetry;

/// Nodes over which coverage ends outside the domain, in spacings.
pub(crate) const MARGIN: f64 = 2.0;

/// Over this outside a ball, in spacings, the radial slope comes to rest: a tenth of a node further
/// out, where nearly all that is read is kept for the ball itself.
const REST: f64 = 0.4;

/// The nodes of a rotation domain and how queries find them.
#[derive(Debug, Clone)]
pub(super) struct Atlas {
    /// In the order of a table's rows.
    pub(super) nodes: Vec<DQuat>,
    /// The chart of each and its place there, in C order; of a list, nothing.
    pub(super) places: Vec<[u32; 2]>,
    pub(super) charts: Vec<Chart>,
    pub(super) patches: Vec<Patch>,
    pub(super) symmetry: Option<Symmetry>,
    pub(super) cover: Cover,
    /// Angle between neighbouring nodes, radians.
    pub(super) step: f64,
    /// Angle outside the domain over which what is read fades, radians.
    pub(super) fade: f64,
}

/// One image of a chart under the symmetry: queries near `image` are turned onto the chart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    pub(super) chart: usize,
    /// The chart's centre, turned back by `turn`.
    pub(super) image: DQuat,
    /// The symmetry's turn that takes queries near `image` onto the chart.
    pub(super) turn: DQuat,
}

/// How coverage ends.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cover {
    All,
    /// Beyond this angle from the centre, over the margin; radians.
    Ball {
        center: DQuat,
        angle: f64,
        margin: f64,
    },
    /// With the tilt away from the spin axis; and beyond the ends of the range, `margin` nodes.
    Spin {
        margin: f64,
    },
    /// With the angle from the nearest listed rotation.
    List {
        margin: f64,
    },
}

impl Atlas {
    /// Where a rotation, turned onto its chart, is read instead.
    pub(super) fn radial_stop(&self, q: DQuat) -> Option<RadialStop> {
        match self.cover {
            Cover::Ball { center, angle, .. } => {
                RelativeRotation::from_center(q, center).radial_stop(angle, REST * self.step)
            }
            _ => None,
        }
    }

    /// Cosine of half the angle from the query to the patch's image (for a body of revolution, to
    /// the nearest of its images).
    pub(super) fn closeness(&self, patch: usize, q: DQuat) -> f64 {
        let image = self.patches[patch].image;
        match &self.symmetry {
            Some(s) if s.is_continuous() => s.swing_closeness(q, image),
            _ => q.dot(image).abs(),
        }
    }

    /// Gradient of [`Self::closeness`] by a turn of `q`.
    fn closeness_gradient(&self, patch: usize, q: DQuat) -> DVec3 {
        let image = self.patches[patch].image;
        match &self.symmetry {
            Some(s) if s.is_continuous() => s.swing_closeness_gradient(q, image),
            _ => {
                let toward = image * q.conjugate();
                0.5 * toward.w.signum() * toward.xyz()
            }
        }
    }

    /// Share of a patch before division by the sum: a product over the seams with all others.
    pub(super) fn blend_weight(&self, patch: usize, q: DQuat) -> (f64, DVec3) {
        let own = self.closeness(patch, q);
        let own_gradient = self.closeness_gradient(patch, q);
        let (mut share, mut log_gradient) = (1.0, DVec3::ZERO);
        for other in (0..self.patches.len()).filter(|&k| k != patch) {
            let width = self.seam_width(patch, other);
            let theirs = self.closeness(other, q);
            let place = theirs.atan2(own) - FRAC_PI_4;
            if place <= -width {
                continue;
            }
            let (factor, slope) = fade((place + width) / (2.0 * width));
            if factor <= 0.0 {
                return (0.0, DVec3::ZERO);
            }
            let turn = own * self.closeness_gradient(other, q) - theirs * own_gradient;
            share *= factor;
            log_gradient += slope / (2.0 * width) / factor * turn / (own * own + theirs * theirs);
        }
        (share, share * log_gradient)
    }

    /// Half the width of a seam in the angle whose tangent is the ratio of closenesses: about one
    /// node of the chart on each side.
    fn seam_width(&self, a: usize, b: usize) -> f64 {
        seam_width(
            self.patches[a].image,
            self.patches[b].image,
            &self.symmetry,
            0.5 * self.step,
        )
    }
}

fn seam_width(a: DQuat, b: DQuat, symmetry: &Option<Symmetry>, half_step: f64) -> f64 {
    let half_apart = match symmetry {
        Some(s) if s.is_continuous() => FRAC_PI_4,
        _ => 0.5 * a.dot(b).abs().min(1.0).acos(),
    };
    half_step.min(0.9 * half_apart) * half_apart.tan()
}

/// A rotation from another by an angle, scalar part not negative.
#[derive(Debug, Clone, Copy)]
pub(super) struct RelativeRotation {
    pub(super) rotation: DQuat,
    /// Radians.
    pub(super) angle: f64,
}

impl RelativeRotation {
    /// From `center` to `q`.
    pub(super) fn from_center(q: DQuat, center: DQuat) -> Self {
        Self::from_rotation(q * center.conjugate())
    }

    pub(super) fn from_rotation(r: DQuat) -> Self {
        let rotation = if r.w < 0.0 { -r } else { r };
        Self {
            rotation,
            angle: 2.0 * rotation.xyz().length().atan2(rotation.w),
        }
    }

    /// 1 up to `angle`, 0 from `angle + margin` (radians), with its gradient by a turn.
    pub(super) fn beyond(&self, angle: f64, margin: f64) -> (f64, DVec3) {
        if self.angle <= angle {
            return (1.0, DVec3::ZERO);
        }
        let (value, slope) = fade((self.angle - angle) / margin);
        let sine = self.rotation.xyz().length();
        let outwards = self.rotation.xyz() / sine.max(1e-300);
        (value, slope / margin * outwards)
    }

    /// Where a rotation outside a ball of radius `angle` is read; `None` inside.
    pub(super) fn radial_stop(&self, angle: f64, margin: f64) -> Option<RadialStop> {
        (self.angle > angle).then(|| RadialStop::new(self.rotation, self.angle, angle, margin))
    }
}

/// How a rotation outside a ball moves where it is read: towards the centre about the axis that
/// leads there, so that the radial slope comes to rest just outside.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RadialStop {
    axis: DVec3,
    /// Angle by which the rotation is turned, about the axis.
    turn: f64,
    /// What a turn about the axis becomes, per radian.
    along: f64,
    /// What a turn across the axis becomes, before it is turned by half of `turn`.
    across: f64,
}

impl RadialStop {
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
            let rest = RadialStop::new(r, found, angle, margin);
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
