//! Docked poses as they are reported.

use std::borrow::Cow;

use fft_correlate::mating::{Joint, JointKind};
use fft_correlate::{DockingPose, Placement, Pose};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A pose found, in the scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct DockedPose {
    pub(super) position: [f64; 3],
    pub(super) rotation: [f64; 4],
    /// What ranks poses by contact, nats.
    pub(super) hold: f64,
    /// Information of contact, nats.
    pub(super) information: f64,
    /// Area of the moving part's faces that lie against opposite faces of the fixed one, square
    /// metres, and its share of the moving part's surface.
    pub(super) mating_area: f64,
    pub(super) mating_share: f64,
    /// Share of the directions in which nothing blocks a displacement.
    pub(super) escape: f64,
    /// Share of the moving part's volume that the fixed part fills as well.
    pub(super) overlap: f64,
    /// How deep a point of either part lies in the other at most, metres.
    pub(super) penetration: f64,
    /// The score as a share of what the smaller part would score in a perfect mould of itself, 0 to 1.
    pub(super) quality: Option<f64>,
    /// Under the docking weights, joules.
    pub(super) energy: Option<f64>,
    /// Under the scene's model, joules.
    pub(super) model_energy: Option<f64>,
    pub(super) joint: DockedJoint,
    /// Other poses in which the same contact holds the part: position and rotation of each.
    pub(super) alike: Vec<([f64; 3], [f64; 4])>,
    pub(super) half_width: Option<f64>,
    pub(super) refined: bool,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses of a search by energy only.
    pub(super) condition: Option<f64>,
}

/// What contact leaves free.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct DockedJoint {
    pub(super) kind: Cow<'static, str>,
    /// Motions that are free.
    pub(super) freedoms: usize,
    /// In the scene: direction, and a point, metres; none of joints without an axis.
    pub(super) axis: Option<[f64; 3]>,
    pub(super) point: Option<[f64; 3]>,
    /// The same in the moving part's frame, as it lies in the scene before it is moved.
    pub(super) moving_axis: Option<[f64; 3]>,
    pub(super) moving_point: Option<[f64; 3]>,
    /// Metres per turn of a screw, positive if right-handed.
    pub(super) pitch: Option<f64>,
    /// Travel along the axis, metres, and about it, radians, from the pose.
    pub(super) slide: Option<[f64; 2]>,
    pub(super) turn: Option<[f64; 2]>,
}

impl DockedPose {
    pub(super) fn new(pose: &DockingPose, placement: &Placement) -> Self {
        let found = &pose.found;
        let row = |pose: &Pose| {
            let at = placement.to_scene(pose);
            (at.translation.to_array(), at.rotation.to_array())
        };
        let (position, rotation) = row(&found.pose);
        let known = |v: f64| v.is_finite().then_some(v);
        Self {
            position,
            rotation,
            hold: pose.rank,
            information: pose.hold.information,
            mating_area: pose.mating_area,
            mating_share: pose.hold.share,
            escape: pose.hold.escape,
            overlap: pose.overlap,
            penetration: pose.interference.depth,
            quality: known(pose.quality),
            energy: known(found.energy),
            model_energy: known(pose.model_energy),
            joint: DockedJoint::new(&pose.joint, &found.pose, placement),
            alike: pose.alike.iter().map(row).collect(),
            half_width: found.half_width,
            refined: found.refined,
            condition: pose.condition,
        }
    }
}

impl DockedJoint {
    fn new(joint: &Joint, pose: &Pose, placement: &Placement) -> Self {
        let has_axis = joint.axis != DVec3::ZERO;
        let has_point = has_axis || joint.kind == JointKind::Ball;
        let fixed = placement.fixed;
        let (axis, point) = joint.in_moving_frame(pose);
        let moving = placement.moving;
        Self {
            kind: joint.kind.name().into(),
            freedoms: joint.kind.freedoms(),
            axis: has_axis.then(|| (fixed.rotation * joint.axis).to_array()),
            point: has_point.then(|| fixed.apply(joint.point).to_array()),
            moving_axis: has_axis.then(|| (moving.rotation * axis).to_array()),
            moving_point: has_point.then(|| moving.apply(point).to_array()),
            pitch: (joint.kind == JointKind::Screw).then_some(joint.pitch),
            slide: joint.slide.map(|t| t.range),
            turn: joint.turn.map(|t| t.range),
        }
    }
}
