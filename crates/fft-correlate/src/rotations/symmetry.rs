//! The symmetry of two parts: fewer rotations in a table, equal fits. A pose is turned by a symmetry
//! onto the rotations that a table holds, and its wrench back.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use sdf_grid::{SymmetryAxis, SymmetryOrder, TriangleMesh, symmetry};

use crate::geometry::se3::{Pose, Wrench};
use crate::geometry::side::Side;
use crate::rotations::domain::{AxisSymmetry, RotationDomain};

/// Deviation from symmetry that counts as none, in lattice spacings: what a lattice cannot tell
/// apart is symmetric enough.
const TOLERANCE: f64 = 0.02;

/// The highest order by which a rotation grid can be shortened.
const HIGHEST_ORDER: u32 = 64;

/// The symmetry axes of a part that lattices of `spacing` metres do not tell from exact ones,
/// highest order first.
pub fn symmetry_on_lattice(mesh: &TriangleMesh, spacing: f64) -> Vec<SymmetryAxis> {
    symmetry::detect(mesh, TOLERANCE * spacing)
}

/// The symmetry by which a table of `rotations` leaves out nodes: the axis of highest order of
/// either part, the fixed one's of two alike. Lists and spins are taken as they are written.
pub(crate) fn table_symmetry(
    rotations: &RotationDomain,
    fixed: &[SymmetryAxis],
    moving: &[SymmetryAxis],
) -> Option<AxisSymmetry> {
    use RotationDomain::{Ball, Full};
    if !matches!(rotations, Ball { .. } | Full { .. }) {
        return None;
    }
    let of = |part, axes: &[SymmetryAxis]| {
        axes.first().map(|axis| AxisSymmetry {
            part,
            axis: axis.direction.to_array(),
            point: axis.point.to_array(),
            order: match axis.order {
                SymmetryOrder::Continuous => 0,
                SymmetryOrder::Finite(n) => n,
            },
        })
    };
    // An order beyond what grids accept is of no use to them.
    [of(Side::Moving, moving), of(Side::Fixed, fixed)]
        .into_iter()
        .flatten()
        .filter(|s| s.order <= HIGHEST_ORDER)
        .max_by_key(|s| if s.order == 0 { u32::MAX } else { s.order })
}

/// Distance of the pivot (metres) and angle (radians) between `pose` and `fit`, or that of the fits
/// that differ by a motion of `group` which is nearest in angle; `group` maps the moving part onto
/// itself ([`crate::symmetry_group`]).
pub fn from_fit(pose: &Pose, fit: &Pose, pivot: DVec3, group: &[Pose]) -> (f64, f64) {
    group
        .iter()
        .map(|turn| *fit * *turn)
        .map(|same| {
            let away = same.apply(pivot).distance(pose.apply(pivot));
            (away, same.angle_to(pose))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((f64::NAN, f64::NAN))
}

/// A validated part symmetry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Symmetry {
    part: Side,
    axis: DVec3,
    point: DVec3,
    order: u32,
}

/// What was done to a pose, enough to bring its wrench back.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fold {
    Identity,
    /// The moving part was turned in its own frame, which moved its origin by `shift` (fixed frame,
    /// metres).
    Moving {
        shift: DVec3,
        slide: Option<TwistCorrection>,
    },
    /// The fixed part was turned: the whole pose by `turn`.
    Fixed {
        turn: DQuat,
        slide: Option<TwistCorrection>,
    },
}

/// A turn that itself depends on the pose: it keeps the twist about the axis at zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TwistCorrection {
    /// The axis at the folded pose: direction, and a point relative to the moving part's origin.
    axis: DVec3,
    arm: DVec3,
    /// Angle by which a small turn `omega` of the folded pose is turned back: `omega . rate`.
    rate: DVec3,
}

impl TwistCorrection {
    /// The wrench against perturbations of the pose before the slide.
    fn pull_back(&self, wrench: &Wrench) -> Wrench {
        let work = self.axis.dot(wrench.about(self.arm).torque);
        Wrench {
            torque: wrench.torque - work * self.rate,
            force: wrench.force,
        }
    }
}

impl Fold {
    pub(crate) fn pull_back(&self, wrench: &Wrench) -> Wrench {
        match self {
            Self::Identity => *wrench,
            Self::Moving { shift, slide } => {
                let w = slide.map_or(*wrench, |s| s.pull_back(wrench));
                Wrench {
                    torque: w.torque + shift.cross(w.force),
                    force: w.force,
                }
            }
            Self::Fixed { turn, slide } => {
                let w = slide.map_or(*wrench, |s| s.pull_back(wrench));
                let back = turn.conjugate();
                Wrench {
                    torque: back * w.torque,
                    force: back * w.force,
                }
            }
        }
    }
}

impl Symmetry {
    pub(crate) fn new(symmetry: &AxisSymmetry) -> Self {
        Self {
            part: symmetry.part,
            axis: DVec3::from_array(symmetry.axis).normalize(),
            point: DVec3::from_array(symmetry.point),
            order: symmetry.order,
        }
    }

    /// A body of revolution.
    pub(crate) fn is_continuous(&self) -> bool {
        self.order == 0
    }

    /// Half the angle between neighbouring images of a rotation, radians; infinite for a body of
    /// revolution, whose images are one.
    pub(crate) fn half_turn(&self) -> f64 {
        match self.order {
            0 => f64::INFINITY,
            n => PI / f64::from(n),
        }
    }

    /// The turns of a prism; for a body of revolution only the identity, the rest is continuous.
    pub(crate) fn turns(&self) -> Vec<DQuat> {
        (0..self.order.max(1))
            .map(|k| {
                DQuat::from_axis_angle(self.axis, TAU * f64::from(k) / f64::from(self.order.max(1)))
            })
            .collect()
    }

    /// `q` after the part is turned.
    pub(crate) fn turned(&self, q: DQuat, turn: DQuat) -> DQuat {
        match self.part {
            Side::Moving => q * turn,
            Side::Fixed => turn * q,
        }
    }

    /// `center` with the symmetry axis upside down.
    pub(crate) fn flipped(&self, center: DQuat) -> DQuat {
        self.turned(
            center,
            DQuat::from_axis_angle(self.axis.any_orthonormal_vector(), PI),
        )
    }

    /// Chart axes with z along the symmetry axis and x along that of [`Self::flipped`], both as
    /// they lie in the fixed frame for rotation `center`.
    pub(crate) fn frame(&self, center: DQuat) -> DQuat {
        let turn = match self.part {
            Side::Moving => center,
            Side::Fixed => DQuat::IDENTITY,
        };
        let (x, z) = (self.axis.any_orthonormal_vector(), self.axis);
        let axes = glam::DMat3::from_cols(x, z.cross(x), z);
        turn * DQuat::from_mat3(&axes).normalize()
    }

    /// The rotation from `center` to `q` in the frame in which the axis is [`Self::axis`].
    fn relative(&self, q: DQuat, center: DQuat) -> DQuat {
        match self.part {
            Side::Moving => center.conjugate() * q,
            Side::Fixed => q * center.conjugate(),
        }
    }

    /// A vector of the frame of [`Self::relative`] in the fixed frame.
    fn in_fixed_frame(&self, v: DVec3, center: DQuat) -> DVec3 {
        match self.part {
            Side::Moving => center * v,
            Side::Fixed => v,
        }
    }

    /// Cosine of half the tilt between `q` and `center`, whatever the twist.
    pub(crate) fn swing_closeness(&self, q: DQuat, center: DQuat) -> f64 {
        let p = self.relative(q, center);
        p.w.hypot(p.xyz().dot(self.axis))
    }

    /// Gradient of [`Self::swing_closeness`] by a turn of `q` in the fixed frame.
    pub(crate) fn swing_closeness_gradient(&self, q: DQuat, center: DQuat) -> DVec3 {
        let p = self.relative(q, center);
        let (v, along) = (p.xyz(), p.xyz().dot(self.axis));
        let gradient = along * (p.w * self.axis + v.cross(self.axis)) - p.w * v;
        let closeness = p.w.hypot(along).max(1e-12);
        self.in_fixed_frame(0.5 / closeness * gradient, center)
    }

    /// The pose with the part turned by `turn` or, for a body of revolution, until there is no
    /// twist from `center`.
    pub(crate) fn fold(&self, pose: &Pose, turn: DQuat, center: DQuat) -> (Pose, Fold) {
        let turn = if self.is_continuous() {
            let p = self.relative(pose.rotation, center);
            let half = -p.xyz().dot(self.axis).atan2(p.w);
            DQuat::from_axis_angle(self.axis, 2.0 * half)
        } else {
            turn
        };
        let about_axis = Pose {
            rotation: turn,
            translation: self.point - turn * self.point,
        };
        match self.part {
            Side::Moving => {
                let folded = *pose * about_axis;
                let arm = folded.rotation * self.point;
                let slide = self.slide(&folded, center, folded.rotation * self.axis, arm);
                let shift = folded.translation - pose.translation;
                (folded, Fold::Moving { shift, slide })
            }
            Side::Fixed => {
                let folded = about_axis * *pose;
                let arm = self.point - folded.translation;
                let slide = self.slide(&folded, center, self.axis, arm);
                (folded, Fold::Fixed { turn, slide })
            }
        }
    }

    fn slide(
        &self,
        folded: &Pose,
        center: DQuat,
        axis: DVec3,
        arm: DVec3,
    ) -> Option<TwistCorrection> {
        if !self.is_continuous() {
            return None;
        }
        let mut p = self.relative(folded.rotation, center);
        if p.w < 0.0 {
            p = -p;
        }
        // No twist: v . a = 0. A turn changes it by omega . k / 2, the slide by w / 2 per radian.
        let k = p.w * self.axis + p.xyz().cross(self.axis);
        let rate = self.in_fixed_frame(k / p.w.max(1e-9), center);
        Some(TwistCorrection { axis, arm, rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotations::search_rotations::symmetry_group;
    use glam::DQuat;

    fn axis(direction: DVec3, order: SymmetryOrder) -> SymmetryAxis {
        SymmetryAxis {
            point: DVec3::ZERO,
            direction,
            order,
        }
    }

    #[test]
    fn the_highest_order_that_a_grid_accepts_is_taken() {
        let four = [axis(DVec3::Z, SymmetryOrder::Finite(4))];
        let two = [axis(DVec3::X, SymmetryOrder::Finite(2))];
        let many = [axis(DVec3::X, SymmetryOrder::Finite(100))];
        let round = [axis(DVec3::Y, SymmetryOrder::Continuous)];
        let ball = RotationDomain::ball(20.0, 5.0);
        let chosen = |fixed: &[_], moving: &[_]| {
            table_symmetry(&ball, fixed, moving).map(|s| (s.part, s.order))
        };
        assert_eq!(chosen(&four, &two), Some((Side::Fixed, 4)));
        assert_eq!(chosen(&two, &two), Some((Side::Fixed, 2)));
        assert_eq!(chosen(&round, &four), Some((Side::Fixed, 0)));
        assert_eq!(chosen(&many, &two), Some((Side::Moving, 2)));
        assert_eq!(chosen(&[], &[]), None);
        let list = RotationDomain::List {
            rotations: vec![[0.0, 0.0, 0.0, 1.0]],
            margin_deg: 5.0,
        };
        assert_eq!(table_symmetry(&list, &four, &two), None);
    }

    #[test]
    fn a_fit_turned_by_two_axes_is_still_the_fit() {
        let axes = [
            axis(DVec3::Z, SymmetryOrder::Finite(4)),
            axis(DVec3::X, SymmetryOrder::Finite(2)),
        ];
        let fit = Pose::from_translation(DVec3::new(0.01, 0.0, 0.0));
        let turn = DQuat::from_rotation_x(std::f64::consts::PI)
            * DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let pose = fit * Pose::new(turn, DVec3::ZERO);
        let (away, angle) = from_fit(&pose, &fit, DVec3::ZERO, &symmetry_group(&axes));
        assert!(away < 1e-12 && angle < 1e-6, "{away} {angle}");
    }
}
