//! Places that a joint carries into each other: a leg may turn in its thread.

use std::f64::consts::TAU;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, JointKind};
use glam::{DQuat, DVec3};
use sdf_grid::Aabb;

/// A joint carries a part from one place to another if it comes so near, diagonals.
const CARRIED: f64 = 0.03;

/// A joint in a frame that a motion carries it to.
pub(crate) fn moved_joint(joint: &Joint, motion: &Pose) -> Joint {
    Joint {
        axis: motion.rotation * joint.axis,
        point: motion.apply(joint.point),
        ..joint.clone()
    }
}

/// Whether a joint that holds a part at one pose carries it to another: by a turn about its axis and
/// the slide that goes with it, however far both go.
pub(crate) fn carries(joint: &Joint, from: &Pose, to: &Pose, bounds: &Aabb) -> bool {
    if !joint.kind.turns() {
        return false;
    }
    let between = to.rotation * from.rotation.conjugate();
    let angle = 2.0 * between.xyz().dot(joint.axis).atan2(between.w);
    let turn = DQuat::from_axis_angle(joint.axis, angle);
    let turned = |p: DVec3| joint.point + turn * (from.apply(p) - joint.point);
    let centre = bounds.center();
    let shift = (to.apply(centre) - turned(centre)).dot(joint.axis);
    let along = match joint.kind {
        JointKind::Cylindrical => shift,
        // A full turn more or less is the same turn.
        JointKind::Screw => {
            let own = joint.pitch * angle / TAU;
            own + joint.pitch * ((shift - own) / joint.pitch).round()
        }
        _ => 0.0,
    };
    let near = CARRIED * bounds.diagonal();
    (bounds.corners().into_iter()).all(|corner| {
        to.apply(corner)
            .distance(turned(corner) + along * joint.axis)
            <= near
    })
}

/// How far a part at one pose is turned from its place at another, radians: up to its symmetries, and
/// where it may turn there, by its axis alone.
pub(crate) fn turned(from: &(Pose, Joint), to: &Pose, symmetries: &[Pose]) -> f64 {
    let (at, joint) = from;
    match joint.kind.turns() {
        true => {
            let (axis, _) = joint.in_moving_frame(at);
            joint.axis.angle_between(to.rotation * axis)
        }
        false => (symmetries.iter())
            .map(|s| at.angle_to(&(*to * *s)))
            .fold(f64::INFINITY, f64::min),
    }
}

/// Drops places that a joint carries an earlier one to.
pub(crate) fn distinct(places: &mut Vec<(Pose, Joint)>, bounds: &Aabb) {
    let mut kept: Vec<(Pose, Joint)> = Vec::new();
    for (pose, joint) in places.drain(..) {
        let known = |(at, joint): &(Pose, Joint)| carries(joint, at, &pose, bounds);
        if !kept.iter().any(known) {
            kept.push((pose, joint));
        }
    }
    *places = kept;
}
