//! Visited poses: nodes of a search, how they are stored, and which poses duplicate them.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::collision::body::Body;
use crate::collision::checker::CollisionChecker;
use crate::error::PathError;
use crate::motion::vec6::{Vec6, scaled};

/// Poses that a search has reached from a goal at the tolerance; a later search continues from
/// them. Empty at first, belongs to one request, and can be written to a file.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::Pose;
/// use pegfit_path::{Outcome, PathRequest, PathSearch, VisitedPoses};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(2e-4)?;
/// let request = PathRequest { others: 0.0, ..PathRequest::default() };
/// let search = PathSearch::new(Arc::new(hole), Arc::new(peg), request)?;
/// let mut visited = VisitedPoses::default();
/// assert_eq!(visited.count(), 0);
/// let result = search.find_from(&Pose::IDENTITY, None, &mut visited, &Silent)?;
/// // Kept for a search that goes on where this one ended.
/// assert!(result.outcome == Outcome::Free && visited.count() > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VisitedPoses {
    question: Option<Question>,
    /// Finished passes, coarse to fine.
    pub(crate) passes: usize,
    /// Nodes of the current pass.
    pub(crate) nodes: Vec<Node>,
}

/// The request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    fixed: String,
    moving: String,
    goal: [f64; 7],
    level: f64,
}

impl VisitedPoses {
    /// Number of poses.
    pub fn count(&self) -> usize {
        self.nodes.len()
    }

    /// Whether nothing has been visited yet.
    pub(crate) fn is_new(&self) -> bool {
        self.passes == 0 && self.nodes.is_empty()
    }

    /// Begins a request, or continues it.
    ///
    /// # Errors
    /// If the poses belong to another request, or do not lead from one to the next.
    pub(crate) fn check_request(
        &mut self,
        [fixed, moving]: [&Body; 2],
        goal: &Pose,
        level: f64,
    ) -> Result<(), PathError> {
        let asked = Question {
            fixed: hashes(fixed),
            moving: hashes(moving),
            goal: seven(goal),
            level,
        };
        let refused = |item| Err(PathError::Visited { item });
        if let Some(known) = &self.question {
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (1.0 + a.abs());
            let same_goal = known
                .goal
                .iter()
                .zip(&asked.goal)
                .all(|(a, b)| near(*a, *b));
            match () {
                () if known.fixed != asked.fixed => return refused("the fixed part"),
                () if known.moving != asked.moving => return refused("the moving part"),
                () if !same_goal => return refused("the goal"),
                () if !near(known.level, asked.level) => return refused("the tolerance"),
                () => {}
            }
        }
        let earlier = |(i, node): (usize, &Node)| match &node.from {
            None => i == 0,
            Some((from, _)) => *from < i,
        };
        if !self.nodes.iter().enumerate().all(earlier) {
            return refused("what leads where");
        }
        self.question = Some(asked);
        Ok(())
    }
}

/// Identifies a body by the hashes of its meshes.
fn hashes(body: &Body) -> String {
    let bytes = body
        .meshes()
        .flat_map(|mesh| mesh.hash().into_iter().take(16));
    bytes.map(|byte| format!("{byte:02x}")).collect()
}

/// A pose that has been reached, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "Stored", try_from = "Stored")]
pub(crate) struct Node {
    pub(crate) pose: Pose,
    /// The node that it was reached from, an earlier one, and the poses between.
    pub(crate) from: Option<(usize, Vec<Pose>)>,
    pub(crate) last: Option<Vec6>,
    /// Exit distance, metres.
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

/// Points that are compared.
const POINTS: usize = 96;

/// A motion by this share of the radius shows whether it changes anything.
const SOME_TURN: f64 = 0.37;

/// Points of the moving part's surface, in its own frame, metres.
#[derive(Debug, Clone)]
pub(crate) struct DuplicateFilter {
    points: Vec<DVec3>,
}

impl DuplicateFilter {
    pub(crate) fn new(checker: &CollisionChecker) -> Self {
        let extremes = &checker.frame.extremes;
        let vertices: Vec<DVec3> = checker.moving.vertices().copied().collect();
        let step = (vertices.len() / POINTS).max(1);
        let some = vertices.iter().step_by(step).take(POINTS);
        let outer = extremes.iter().step_by((extremes.len() / POINTS).max(1));
        Self {
            points: some.chain(outer).copied().collect(),
        }
    }

    /// Whether the part at `a` fills what it fills at `b`, to within `within` metres: every point at one
    /// lies that close to the surface at the other.
    pub(crate) fn is_same_place(
        &self,
        checker: &CollisionChecker,
        a: &Pose,
        b: &Pose,
        within: f64,
    ) -> bool {
        let centre = checker.frame.centre;
        if a.apply(centre).distance(b.apply(centre)) > within {
            return false;
        }
        let from = b.inverse() * *a;
        let near = |p: &DVec3| {
            checker
                .moving
                .probes(from.apply(*p), within)
                .next()
                .is_some()
        };
        self.points.iter().all(near)
    }

    /// Whether a motion from `start` is a turn about an axis of symmetry, which leads nowhere.
    pub(crate) fn is_symmetric_motion(
        &self,
        checker: &CollisionChecker,
        start: &Pose,
        motion: &Vec6,
        within: f64,
    ) -> bool {
        let far = SOME_TURN * checker.frame.radius / checker.frame.largest(start, motion);
        let turned = checker.frame.moved(start, &scaled(motion, far));
        self.is_same_place(checker, start, &turned, within)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sdf_grid::shapes::PegInHole;

    use super::*;

    #[test]
    fn symmetric_poses_are_the_same_and_others_are_not() {
        let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let checker = CollisionChecker::new(
            Body::of_mesh(Arc::new(hole)),
            Body::of_mesh(Arc::new(peg)),
            1e-3,
        );
        let shape = DuplicateFilter::new(&checker);
        let about_z = |angle: f64| Pose::new(DQuat::from_rotation_z(angle), DVec3::ZERO);
        let quarter = std::f64::consts::FRAC_PI_2;
        let same = |a, b| shape.is_same_place(&checker, &a, &b, 2e-4);
        assert!(same(about_z(0.1), about_z(0.1 + quarter)));
        assert!(!same(about_z(0.1), about_z(0.2)));
        assert!(!same(
            Pose::IDENTITY,
            Pose::from_translation(DVec3::Z * 3e-4)
        ));
    }
}
