//! When two poses of a part count as the same, and distinct ones among many.

use glam::DVec3;

use crate::geometry::se3::Pose;

/// When two poses count as the same.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PoseSpacing {
    /// Rotations up to this angle apart, radians.
    pub(crate) angle: f64,
    /// Pivots up to this distance apart, metres.
    pub(crate) distance: f64,
    /// Point of the moving part whose positions are compared, metres in its frame.
    pub(crate) pivot: DVec3,
    /// Motions that map the moving part onto itself, in its own frame; the identity need not be
    /// among them.
    pub(crate) symmetries: Vec<Pose>,
}

impl PoseSpacing {
    /// True if the rotations and the pivots are both close, for the part as it is or under one of
    /// its symmetries.
    pub(crate) fn is_same(&self, a: &Pose, b: &Pose) -> bool {
        let close = |b: &Pose| {
            (a.apply(self.pivot) - b.apply(self.pivot)).length() <= self.distance
                && a.angle_to(b) <= self.angle
        };
        close(b) || self.symmetries.iter().any(|s| close(&(*b * *s)))
    }

    /// Indices of at most `count` poses, taken in order, none of which is the same as one taken
    /// before.
    pub(crate) fn distinct<'a>(
        &self,
        poses: impl IntoIterator<Item = &'a Pose>,
        count: usize,
    ) -> Vec<usize> {
        // No symmetry moves the pivot farther than this: most pairs need no closer look.
        let moved = |s: &Pose| s.apply(self.pivot).distance(self.pivot);
        let reach = self.distance + self.symmetries.iter().map(moved).fold(0.0, f64::max);
        let mut kept: Vec<(usize, &Pose, DVec3)> = Vec::new();
        for (index, pose) in poses.into_iter().enumerate() {
            if kept.len() == count {
                break;
            }
            let place = pose.apply(self.pivot);
            let near = |k: &DVec3| k.distance(place) <= reach;
            if !kept
                .iter()
                .any(|(_, k, at)| near(at) && self.is_same(k, pose))
            {
                kept.push((index, pose, place));
            }
        }
        kept.into_iter().map(|(index, ..)| index).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, TAU};

    use glam::DQuat;

    use super::*;

    #[test]
    fn poses_equal_under_a_symmetry_are_the_same() {
        let turn = |angle| Pose::new(DQuat::from_rotation_z(angle), DVec3::ZERO);
        let mut spacing = PoseSpacing {
            angle: 0.1,
            distance: 0.01,
            pivot: DVec3::new(0.0, 0.0, 0.5),
            symmetries: vec![],
        };
        let poses = [turn(0.0), turn(FRAC_PI_2), turn(0.05), turn(TAU / 8.0)];
        assert_eq!(spacing.distinct(&poses, 9), [0, 1, 3]);
        spacing.symmetries = (1..4).map(|n| turn(n as f64 * FRAC_PI_2)).collect();
        assert_eq!(spacing.distinct(&poses, 9), [0, 3]);
        assert_eq!(spacing.distinct(&poses, 1), [0]);
        let shifted = Pose::from_translation(DVec3::new(0.02, 0.0, 0.0));
        assert!(!spacing.is_same(&shifted, &poses[0]));
    }
}
