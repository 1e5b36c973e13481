//! Whether a part takes the same place at two poses, its symmetries included.

use fft_correlate::Pose;
use glam::DVec3;

use crate::contact::gaps::Gaps;
use crate::motion::six::{Vec6, scaled};

/// Points that are compared.
const POINTS: usize = 96;

/// A motion by this share of the radius shows whether it changes anything.
const SOME_TURN: f64 = 0.37;

/// Points of the moving part's surface, in its own frame, metres.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    points: Vec<DVec3>,
}

impl Shape {
    pub(crate) fn new(gaps: &Gaps) -> Self {
        let extremes = &gaps.frame.extremes;
        let vertices: Vec<DVec3> = gaps.moving.vertices().copied().collect();
        let step = (vertices.len() / POINTS).max(1);
        let some = vertices.iter().step_by(step).take(POINTS);
        let outer = extremes.iter().step_by((extremes.len() / POINTS).max(1));
        Self {
            points: some.chain(outer).copied().collect(),
        }
    }

    /// Whether the part at `a` fills what it fills at `b`, to within `within` metres: every point at one
    /// lies that close to the surface at the other.
    pub(crate) fn same(&self, gaps: &Gaps, a: &Pose, b: &Pose, within: f64) -> bool {
        let centre = gaps.frame.centre;
        if a.apply(centre).distance(b.apply(centre)) > within {
            return false;
        }
        let from = b.inverse() * *a;
        let near = |p: &DVec3| gaps.moving.probes(from.apply(*p), within).next().is_some();
        self.points.iter().all(near)
    }

    /// Whether a motion from `start` is a turn about an axis of symmetry, which leads nowhere.
    pub(crate) fn turns_in_itself(
        &self,
        gaps: &Gaps,
        start: &Pose,
        motion: &Vec6,
        within: f64,
    ) -> bool {
        let far = SOME_TURN * gaps.frame.radius / gaps.frame.largest(start, motion);
        let turned = gaps.frame.moved(start, &scaled(motion, far));
        self.same(gaps, start, &turned, within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::Body;
    use glam::DQuat;
    use sdf_grid::shapes::PegInHole;
    use std::sync::Arc;

    #[test]
    fn symmetric_poses_are_the_same_and_others_are_not() {
        let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let gaps = Gaps::new(
            Body::of_mesh(Arc::new(hole)),
            Body::of_mesh(Arc::new(peg)),
            1e-3,
        );
        let shape = Shape::new(&gaps);
        let about_z = |angle: f64| Pose::new(DQuat::from_rotation_z(angle), DVec3::ZERO);
        let quarter = std::f64::consts::FRAC_PI_2;
        let same = |a, b| shape.same(&gaps, &a, &b, 2e-4);
        assert!(same(about_z(0.1), about_z(0.1 + quarter)));
        assert!(!same(about_z(0.1), about_z(0.2)));
        assert!(!same(
            Pose::IDENTITY,
            Pose::from_translation(DVec3::Z * 3e-4)
        ));
    }
}
