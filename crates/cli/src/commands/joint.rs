//! Reading the joint that docking found.

use std::path::Path;

use fft_correlate::Pose;
use fft_correlate::mating::JointKind;
use glam::{DQuat, DVec3};
use haptic::GuidedJoint;
use serde::Deserialize;

use crate::error::CommandError;

/// What is used of a report of `pegfit dock --report`.
#[derive(Deserialize)]
struct Report {
    poses: Vec<DockedPose>,
}

#[derive(Deserialize)]
struct DockedPose {
    position: DVec3,
    rotation: DQuat,
    joint: DockedJoint,
    /// Other places that are alike.
    alike: Vec<(DVec3, DQuat)>,
}

#[derive(Deserialize)]
struct DockedJoint {
    kind: String,
    axis: Option<DVec3>,
    point: Option<DVec3>,
    pitch: Option<f64>,
}

/// The joint of the first pose in a report of docking, in all places that are alike; none without a
/// report.
pub(super) fn read(path: Option<&Path>) -> Result<Vec<GuidedJoint>, CommandError> {
    let Some(path) = path else {
        return Ok(Vec::new());
    };
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| CommandError::read(path, e))?;
    let report: Report =
        serde_json::from_str(&text).map_err(|e| CommandError::bad_input(name.clone(), e))?;
    let Some(first) = report.poses.first() else {
        return Err(CommandError::input(name, "poses", "one or more", "none"));
    };
    let DockedJoint {
        kind,
        axis,
        point,
        pitch,
    } = &first.joint;
    let Some(found) = JointKind::determined(kind) else {
        let expected = "a joint that contact determines";
        return Err(CommandError::input(name, "joint", expected, kind));
    };
    let refused =
        |item, expected, found: String| Err(CommandError::input(&*name, item, expected, found));
    let needs_axis = !matches!(found, JointKind::Fixed | JointKind::Ball);
    let axis = axis.unwrap_or(DVec3::ZERO);
    if needs_axis && !is_one(axis.length()) {
        return refused("axis", "a direction of unit length", format!("{axis}"));
    }
    let pitch = pitch.unwrap_or(0.0);
    if found == JointKind::Screw && !pitch.is_normal() {
        return refused("pitch", "a length other than 0", format!("{pitch}"));
    }
    let point = point.unwrap_or(first.position);
    if !(point.is_finite() && first.position.is_finite()) {
        return refused("point", "finite numbers", format!("{point}"));
    }
    let places =
        std::iter::once((first.position, first.rotation)).chain(first.alike.iter().copied());
    let mut joints: Vec<GuidedJoint> = Vec::new();
    for (position, rotation) in places {
        if !(is_one(rotation.length()) && position.is_finite()) {
            let found = format!("{position}, {rotation}");
            return refused("pose", "a finite position and a unit quaternion", found);
        }
        let pose = Pose::new(rotation.normalize(), position);
        // The part's own axis, in this place.
        let moved = joints.first().map(|first| pose * first.pose.inverse());
        joints.push(GuidedJoint {
            kind: found,
            axis: moved.map_or(axis, |m| m.rotation * axis),
            point: moved.map_or(point, |m| m.apply(point)),
            pitch,
            pose,
        });
    }
    Ok(joints)
}

/// Up to rounding.
fn is_one(length: f64) -> bool {
    (1.0 - 1e-6..1.0 + 1e-6).contains(&length)
}
