//! A joint as single motions in series.

use std::f64::consts::{PI, TAU};

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, JointKind, Travel};
use glam::DVec3;

/// A displacement along an axis, or a turn about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepKind {
    Slide,
    Turn,
}

/// One of the motions in series.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    pub(super) kind: StepKind,
    /// What its joint is called: `slide`, `turn-x`.
    pub(super) name: &'static str,
    /// Unit length, moving part's own frame.
    pub(super) axis: DVec3,
    /// Least and greatest position, metres or radians; without one it has no end.
    pub(super) range: Option<[f64; 2]>,
    /// Its position is this many times that of the first motion of the series.
    pub(super) follows: Option<f64>,
}

/// A joint as motions in series.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Series {
    /// The point that turns leave in its place, moving part's own frame, metres.
    pub(super) anchor: DVec3,
    /// Empty if nothing moves, or if contact does not determine the pose.
    pub(super) steps: Vec<Step>,
    /// More than any displacement along which the parts touch, metres.
    pub(super) reach: f64,
}

impl Series {
    /// The joint of a part at `pose`, both in the frame of the part that it hangs from; no displacement
    /// goes further than `reach`, metres.
    pub(super) fn new(joint: &Joint, pose: &Pose, reach: f64) -> Self {
        let (axis, point) = joint.in_moving_frame(pose);
        let axis = axis.normalize_or_zero();
        let slide = || Step {
            kind: StepKind::Slide,
            name: "slide",
            axis,
            // As far as both parts are long where its end is not known.
            range: Some(joint.slide.map_or([-reach, reach], |t| t.range)),
            follows: None,
        };
        let turn = || Step {
            kind: StepKind::Turn,
            name: "turn",
            axis,
            range: turn_range(joint),
            follows: None,
        };
        let steps = match joint.kind {
            JointKind::Fixed | JointKind::Undetermined(_) => Vec::new(),
            JointKind::Prismatic => vec![slide()],
            JointKind::Revolute => vec![turn()],
            JointKind::Cylindrical => vec![slide(), turn()],
            JointKind::Screw => {
                let along = joint.pitch / TAU;
                let range = turn().range.map(|r| r.map(|angle| angle * along));
                let follower = Step {
                    range: range.map(|[a, b]| [a.min(b), a.max(b)]),
                    follows: Some(along),
                    ..slide()
                };
                vec![turn(), follower]
            }
            JointKind::Planar => {
                let (x, y) = axis.any_orthonormal_pair();
                let across = |name, axis| Step {
                    name,
                    axis,
                    range: None,
                    ..slide()
                };
                vec![across("slide-x", x), across("slide-y", y), turn()]
            }
            JointKind::Ball => {
                let about = |name, axis| Step {
                    name,
                    axis,
                    range: None,
                    ..turn()
                };
                vec![
                    about("turn-x", DVec3::X),
                    about("turn-y", DVec3::Y),
                    about("turn-z", DVec3::Z),
                ]
            }
        };
        let turns = steps.iter().any(|s| s.kind == StepKind::Turn);
        let anchor = if turns { point } else { DVec3::ZERO };
        Self {
            anchor,
            steps,
            reach,
        }
    }
}

/// How far the part turns, if there is an end.
fn turn_range(joint: &Joint) -> Option<[f64; 2]> {
    let travel = joint.turn?;
    let endless = joint.kind != JointKind::Screw && is_whole_turn(&travel);
    (!endless).then_some(travel.range)
}

/// Whether a turn goes half around both ways without being blocked.
fn is_whole_turn(travel: &Travel) -> bool {
    let half = PI - 1e-6;
    travel.range[0] <= -half && travel.range[1] >= half && travel.blocked == [false; 2]
}
