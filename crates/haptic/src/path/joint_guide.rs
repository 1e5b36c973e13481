//! A virtual fixture: energy that keeps a part on the motions that a joint leaves free.

use std::f64::consts::{PI, TAU};

use fft_correlate::mating::JointKind;
use fft_correlate::{Pose, Wrench};
use glam::DVec3;

/// A joint to be followed, in the scene's frame.
///
/// ```
/// use fft_correlate::{EnergySource, Pose, mating::JointKind};
/// use glam::DVec3;
/// use haptic::*;
///
/// let config = HapticConfig { ramp_s: 0.0, ..HapticConfig::default() };
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let source = SumSource::new(DVec3::ZERO, vec![]); // free space
/// let (kind, axis, point) = (JointKind::Prismatic, DVec3::X, DVec3::ZERO);
/// let rail = GuidedJoint { kind, axis, point, pitch: 0.0, pose: Pose::IDENTITY };
/// let spec = OperatorConfig::default().spec();
/// let path = ForcePath::new(&spec, &config, workspace, source.scratch())?;
/// let mut path = path.guided(&[rail]);
/// // The handle is 1 mm beside the rail along x: it is pulled back, but not along the rail.
/// let beside = DeviceState::at_rest(Pose::from_translation(DVec3::new(0.02, 0.001, 0.0)), 0.0);
/// path.step(&source, Some(&beside), 0.0, config.period());
/// let force = path.step(&source, Some(&beside), 0.001, config.period()).wrench.force;
/// assert!(force.y < -0.5 && force.x.abs() < 0.01, "{force}");
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidedJoint {
    /// Which motions are free.
    pub kind: JointKind,
    /// Direction of the axis, unit length; not used by fixed joints and balls.
    pub axis: DVec3,
    /// A point of the axis, or the centre of a ball, metres.
    pub point: DVec3,
    /// Displacement per turn of a screw, metres, positive if right-handed.
    pub pitch: f64,
    /// A pose of the moving part in which it is in the joint.
    pub pose: Pose,
}

/// A joint is followed by springs that give way. At a distance `d` from its motions the energy is
/// `-F w exp(-(sqrt(d² + s²) - s) / w)`: a stiff spring of `F / s` within `s`, a force of nearly
/// `F` beyond, and none far away. Angles count by `sqrt(rotational stiffness / stiffness)` of the
/// coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointGuide {
    joint: GuidedJoint,
    /// The point in the moving part's frame.
    held: DVec3,
    /// `F`, N.
    force: f64,
    /// Square metres per square radian.
    lever: f64,
    /// `s`, metres.
    stretch: f64,
    /// `w`, metres.
    reach: f64,
}

/// How much stiffer than the coupling the springs are, so that the part hardly leaves the joint.
const STIFFER: f64 = 10.0;

/// Force over the coupling's stiffness times this is how far the joint is felt.
const REACH: f64 = 2.0;

/// Places that are alike within this share of a spring's greatest energy are one: the same joint after
/// one of its motions.
const SAME: f64 = 0.5;

/// The guides of a joint in all places that are alike.
pub(crate) fn guides(joints: &[GuidedJoint], springs: [f64; 3]) -> Vec<JointGuide> {
    let mut found: Vec<JointGuide> = Vec::new();
    for joint in joints {
        let known = |g: &JointGuide| g.respond(&joint.pose).0 < -SAME * g.depth();
        if !found.iter().any(known) {
            found.push(JointGuide::new(*joint, springs));
        }
    }
    found
}

impl JointGuide {
    /// With a coupling's stiffness, N/m, its rotational one, N·m/rad, and a greatest force, N, of the
    /// scene.
    fn new(joint: GuidedJoint, [stiffness, rotational, force]: [f64; 3]) -> Self {
        Self {
            joint,
            held: joint.pose.inverse().apply(joint.point),
            force,
            lever: rotational / stiffness,
            stretch: force / (STIFFER * stiffness),
            reach: REACH * force / stiffness,
        }
    }

    /// How much lower the energy is in the joint than far away, joules.
    fn depth(&self) -> f64 {
        self.force * self.reach
    }

    /// Energy, joules, and wrench about the moving part's origin at its pose in the scene.
    pub(crate) fn respond(&self, pose: &Pose) -> (f64, Wrench) {
        let GuidedJoint {
            kind, axis, pitch, ..
        } = self.joint;
        // From the joint's pose: displacement of the point, turn.
        let at = pose.apply(self.held);
        let shift = at - self.joint.point;
        let turn = pose.rotation * self.joint.pose.rotation.conjugate();
        let (v, w) = (turn.xyz(), turn.w);
        // Squared distances, and half their gradients: by the point, and by the turn.
        let along = shift.dot(axis);
        let (mut square, pull) = match kind {
            JointKind::Prismatic | JointKind::Cylindrical | JointKind::Screw => {
                let across = shift - along * axis;
                (across.length_squared(), across)
            }
            JointKind::Planar => (along * along, along * axis),
            _ => (shift.length_squared(), shift),
        };
        let (mut pull, mut twist) = (pull, DVec3::ZERO);
        match kind {
            JointKind::Ball => {}
            JointKind::Fixed | JointKind::Prismatic => {
                square += self.lever * 4.0 * (1.0 - w * w);
                twist += self.lever * 2.0 * w * v;
            }
            _ => {
                let turned = turn * axis;
                square += self.lever * 2.0 * (1.0 - axis.dot(turned));
                twist -= self.lever * turned.cross(axis);
            }
        }
        if kind == JointKind::Screw {
            // How far the part is from its thread, alike after every turn.
            let about = v.dot(axis);
            let size = about * about + w * w;
            let angle = 2.0 * about.atan2(w);
            let ahead = PI * (along - pitch * angle / TAU) / pitch;
            let off = pitch / PI * ahead.sin();
            let slope = ahead.cos() * off;
            square += off * off;
            pull += slope * axis;
            let by_turn = (w * (w * axis + v.cross(axis)) + about * v) / size;
            twist -= slope * pitch / TAU * by_turn;
        }
        let length = (square + self.stretch * self.stretch).sqrt();
        let near = ((self.stretch - length) / self.reach).exp();
        let pushed = -self.force * near / length;
        let force = pushed * pull;
        let wrench = Wrench {
            torque: (at - pose.translation).cross(force) + pushed * twist,
            force,
        };
        (-self.depth() * near, wrench)
    }
}

#[cfg(test)]
mod tests {
    use fft_correlate::Twist;
    use glam::DQuat;

    use super::*;

    fn guide(kind: JointKind) -> JointGuide {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.0, 0.3));
        let joint = GuidedJoint {
            kind,
            axis: DVec3::new(0.6, 0.0, 0.8),
            point: DVec3::new(0.01, -0.02, 0.03),
            pitch: 0.002,
            pose: Pose::new(turn, DVec3::new(-0.02, 0.01, 0.04)),
        };
        JointGuide::new(joint, [1000.0, 1.0, 5.0])
    }

    /// A pose of the joint after a motion of it: an angle about the axis, a displacement along it.
    fn after(guide: &JointGuide, angle: f64, along: f64) -> Pose {
        let GuidedJoint {
            axis, point, pose, ..
        } = guide.joint;
        let turn = DQuat::from_axis_angle(axis, angle);
        let shift = point + turn * (pose.translation - point) + along * axis;
        Pose::new((turn * pose.rotation).normalize(), shift)
    }

    #[test]
    fn the_wrench_is_the_gradient_of_the_energy() {
        for kind in JointKind::DETERMINED {
            let guide = guide(kind);
            for angle in [0.0, 0.2, -2.9] {
                let twist = Twist {
                    angular: DVec3::new(0.003, -0.004, 0.006),
                    linear: DVec3::new(0.001, 0.0017, -0.0008),
                };
                let pose = after(&guide, angle, 0.0013).perturbed(&twist);
                let (_, wrench) = guide.respond(&pose);
                for k in 0..6 {
                    let step = |h: f64| {
                        let mut t = Twist::default();
                        match k {
                            0..3 => t.angular[k] = h,
                            _ => t.linear[k - 3] = h,
                        }
                        guide.respond(&pose.perturbed(&t)).0
                    };
                    let h = 1e-6;
                    let slope = (step(h) - step(-h)) / (2.0 * h);
                    let found = match k {
                        0..3 => wrench.torque[k],
                        _ => wrench.force[k - 3],
                    };
                    assert!(
                        (found + slope).abs() < 1e-5,
                        "{kind:?} {angle} {k}: {found} {slope}"
                    );
                }
            }
        }
    }

    #[test]
    fn free_motions_cost_nothing_and_others_do() {
        for kind in JointKind::DETERMINED {
            let guide = guide(kind);
            let pitch = guide.joint.pitch;
            let (turns, slides) = match kind {
                JointKind::Revolute | JointKind::Planar | JointKind::Ball => (true, false),
                JointKind::Prismatic => (false, true),
                JointKind::Cylindrical => (true, true),
                _ => (false, false),
            };
            let energy = |angle: f64, along: f64| guide.respond(&after(&guide, angle, along)).0;
            let costs = |angle, along| energy(angle, along) > -guide.depth() + 1e-12;
            let rest = -guide.depth();
            assert!((energy(0.0, 0.0) - rest).abs() < 1e-12);
            assert_eq!(!costs(0.3, 0.0), turns, "{kind:?}");
            assert_eq!(!costs(0.0, 0.0007), slides, "{kind:?}");
            if kind == JointKind::Screw {
                let angle = 0.4 + 3.0 * TAU;
                assert!(!costs(angle, pitch * angle / TAU));
            }
            // The same joint after a motion is one, in another place another one.
            let moved = |by: DVec3| GuidedJoint {
                point: guide.joint.point + by,
                pose: Pose::from_translation(by) * guide.joint.pose,
                ..guide.joint
            };
            let places = [DVec3::ZERO, DVec3::splat(1e-5), DVec3::splat(0.1)].map(moved);
            assert_eq!(guides(&places, [1000.0, 1.0, 5.0]).len(), 2);
            // Far away nothing is felt.
            let far = Pose::from_translation(DVec3::new(3.0, -2.0, 0.5));
            assert!(guide.respond(&far).1.force.length() < 1e-9);
        }
    }
}
