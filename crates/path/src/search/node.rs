//! Poses that a search has reached.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::motion::six::Vec6;

/// A pose that has been reached, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "Stored", try_from = "Stored")]
pub(crate) struct Node {
    pub(crate) pose: Pose,
    /// The node that it was reached from, an earlier one, and the poses between.
    pub(crate) from: Option<(usize, Vec<Pose>)>,
    pub(crate) last: Option<Vec6>,
    /// How far it is from being out, metres.
    pub(crate) exit: f64,
    /// Motions to try, found when they are first needed.
    pub(crate) motions: Option<Vec<Vec6>>,
    pub(crate) tried: usize,
}

/// A pose as x, y, z, qx, qy, qz, qw.
type Seven = [f64; 7];

/// A node as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    pose: Seven,
    from: Option<(usize, Vec<Seven>)>,
    last: Option<Vec6>,
    exit: f64,
    motions: Option<Vec<Vec6>>,
    tried: usize,
}

pub(crate) fn seven(pose: &Pose) -> Seven {
    let [x, y, z] = pose.translation.to_array();
    let [qx, qy, qz, qw] = pose.rotation.to_array();
    [x, y, z, qx, qy, qz, qw]
}

fn pose([x, y, z, qx, qy, qz, qw]: Seven) -> Result<Pose, &'static str> {
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    let translation = DVec3::new(x, y, z);
    let pose = Pose {
        rotation,
        translation,
    };
    pose.is_valid().then_some(pose).ok_or("a pose is not one")
}

impl From<Node> for Stored {
    fn from(node: Node) -> Self {
        let all = |poses: Vec<Pose>| poses.iter().map(seven).collect();
        Self {
            pose: seven(&node.pose),
            from: node.from.map(|(at, between)| (at, all(between))),
            last: node.last,
            exit: node.exit,
            motions: node.motions,
            tried: node.tried,
        }
    }
}

impl TryFrom<Stored> for Node {
    type Error = &'static str;

    fn try_from(stored: Stored) -> Result<Self, Self::Error> {
        let motions = stored.motions.iter().flatten().chain(&stored.last);
        let finite = motions.flatten().all(|x| x.is_finite());
        if !(finite && stored.exit.is_finite()) {
            return Err("a motion is not finite");
        }
        if stored
            .motions
            .as_ref()
            .is_none_or(|m| stored.tried > m.len())
            && stored.tried > 0
        {
            return Err("more motions were tried than there are");
        }
        let all = |poses: Vec<Seven>| poses.into_iter().map(pose).collect::<Result<Vec<_>, _>>();
        let from = match stored.from {
            Some((at, between)) => Some((at, all(between)?)),
            None => None,
        };
        Ok(Self {
            pose: pose(stored.pose)?,
            from,
            last: stored.last,
            exit: stored.exit,
            motions: stored.motions,
            tried: stored.tried,
        })
    }
}
