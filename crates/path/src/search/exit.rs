//! Exit distance: how far a part is from being beside the other; and paths that continue outside.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use sdf_grid::TriangleMesh;

use crate::collision::checker::CollisionChecker;
use crate::motion::frame::directions;

/// Directions in which exits are measured.
const DIRECTIONS: usize = 192;

/// Paths differ if their exits make at least this angle (its cosine).
const OTHER: f64 = 0.7;

/// The fixed part's extent in many directions.
#[derive(Debug, Clone)]
pub(crate) struct ExitDistance {
    heights: Vec<(DVec3, f64)>,
}

/// The direction, in the fixed frame, in which the least translation takes the part beyond the other, and
/// its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Exit {
    pub(crate) direction: DVec3,
    /// Metres; negative once there is a gap between the parts' extents.
    pub(crate) distance: f64,
}

/// Poses from the first to one outside, a step apart, and where it left.
#[derive(Debug, Clone)]
pub(crate) struct ExitPath {
    pub(crate) poses: Vec<Pose>,
    pub(crate) exit: Exit,
}

impl ExitPath {
    /// Whether it leaves in another direction than all of `paths`.
    pub(crate) fn differs_from(&self, paths: &[Self]) -> bool {
        let apart = |w: &Self| w.exit.direction.dot(self.exit.direction) < OTHER;
        paths.iter().all(apart)
    }
}

impl ExitDistance {
    pub(crate) fn new(checker: &CollisionChecker) -> Self {
        let height = |u: DVec3| {
            let heights = checker.fixed.vertices().map(|p| p.dot(u));
            heights.fold(f64::MIN, f64::max)
        };
        let normals = face_directions(checker);
        let all = directions(DIRECTIONS).chain(normals);
        Self {
            heights: all.map(|u| (u, height(u))).collect(),
        }
    }

    /// The shortest translation out of the fixed part's extent. Once the parts lie beside each other, a straight
    /// motion along the direction keeps them there.
    pub(crate) fn exit(&self, checker: &CollisionChecker, pose: &Pose) -> Exit {
        let extremes = &checker.frame.extremes;
        let mut best = Exit {
            direction: DVec3::Z,
            distance: f64::INFINITY,
        };
        for (u, height) in &self.heights {
            let own = pose.rotation.conjugate() * *u;
            let lowest = extremes.iter().map(|q| q.dot(own)).fold(f64::MAX, f64::min);
            let distance = height - (lowest + pose.translation.dot(*u));
            if distance < best.distance {
                best = Exit {
                    direction: *u,
                    distance,
                };
            }
        }
        if best.distance < 0.0 {
            best.distance = self.exact(checker, pose, best.direction);
        }
        best
    }

    /// The distance by all vertices of the moving part.
    fn exact(&self, checker: &CollisionChecker, pose: &Pose, direction: DVec3) -> f64 {
        let own = pose.rotation.conjugate() * direction;
        let heights = checker.moving.vertices().map(|q| q.dot(own));
        let lowest = heights.fold(f64::MAX, f64::min);
        let height = |(u, h): &(DVec3, f64)| (*u == direction).then_some(*h);
        let height = self.heights.iter().find_map(height).unwrap_or(f64::MAX);
        height - (lowest + pose.translation.dot(direction))
    }
}

/// Normals of the fixed part's largest flat sides.
fn face_directions(checker: &CollisionChecker) -> Vec<DVec3> {
    let mut sides: Vec<(DVec3, f64)> = Vec::new();
    for [a, b, c] in checker.fixed.meshes().flat_map(TriangleMesh::faces) {
        let normal = (b - a).cross(c - a);
        let (unit, area) = (normal.normalize_or_zero(), normal.length());
        match sides.iter().position(|(n, _)| n.dot(unit) > 1.0 - 1e-6) {
            Some(side) => sides[side].1 += area,
            None if sides.len() < 512 => sides.push((unit, area)),
            None => {}
        }
    }
    sides.sort_by(|a, b| b.1.total_cmp(&a.1));
    sides.truncate(24);
    sides.into_iter().map(|(n, _)| n).collect()
}

/// Poses on the arc between two directions.
const ARC: usize = 24;

/// Continues an exit path straight on until the parts' extents are `room` metres apart.
pub(crate) fn leave(pose: &Pose, exit: &Exit, room: f64) -> Pose {
    Pose {
        translation: pose.translation + (exit.distance + room).max(0.0) * exit.direction,
        ..*pose
    }
}

/// From one pose outside to another: straight away from the fixed part, round it on a sphere on which
/// the parts cannot touch, turning meanwhile, and straight back. The ends are left out.
pub(crate) fn round_outside(
    checker: &CollisionChecker,
    from: (&Pose, &Exit),
    to: (&Pose, &Exit),
) -> Vec<Pose> {
    let centre = checker.fixed.bounds().center();
    let radius = 1.01 * (checker.fixed.radius_about(centre) + checker.frame.radius);
    let [a, b] = [from, to].map(|(pose, exit)| away(checker, pose, exit.direction, centre, radius));
    let middle = |pose: &Pose| pose.apply(checker.frame.centre) - centre;
    let (start, end) = (middle(&a), middle(&b));
    let arc = DQuat::from_rotation_arc(start.normalize(), end.normalize());
    let on_arc = |i: usize| {
        let share = i as f64 / ARC as f64;
        let length = start.length() + share * (end.length() - start.length());
        let place = centre + DQuat::IDENTITY.slerp(arc, share) * start.normalize() * length;
        let rotation = a.rotation.slerp(b.rotation, share);
        Pose::new(rotation, place - rotation * checker.frame.centre)
    };
    std::iter::once(a)
        .chain((1..ARC).map(on_arc))
        .chain([b])
        .collect()
}

/// Along a direction out to a sphere.
fn away(
    checker: &CollisionChecker,
    pose: &Pose,
    direction: DVec3,
    centre: DVec3,
    radius: f64,
) -> Pose {
    let from = pose.apply(checker.frame.centre) - centre;
    // |from + s direction| = radius; inside it there is one positive root.
    let along = from.dot(direction);
    let rest = radius * radius - from.length_squared();
    let far = if rest > 0.0 {
        (along * along + rest).sqrt() - along
    } else {
        0.0
    };
    Pose {
        translation: pose.translation + far * direction,
        ..*pose
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sdf_grid::shapes;

    use super::*;
    use crate::collision::body::Body;

    #[test]
    fn round_the_outside_nothing_touches() {
        let cube = shapes::cuboid(DVec3::splat(0.02)).unwrap();
        let rod = shapes::cuboid(DVec3::new(0.002, 0.002, 0.03)).unwrap();
        let checker = CollisionChecker::new(
            Body::of_mesh(Arc::new(cube)),
            Body::of_mesh(Arc::new(rod)),
            5e-4,
        );
        let exit = |direction| Exit {
            direction,
            distance: -0.001,
        };
        let above = Pose::from_translation(DVec3::Z * 0.026);
        let below = Pose::new(DQuat::from_rotation_x(2.0), DVec3::new(0.0, 0.01, -0.027));
        let (up, down) = (exit(DVec3::Z), exit(-DVec3::Z));
        let path = round_outside(&checker, (&above, &up), (&below, &down));
        let all = [&[above][..], &path, &[below]].concat();
        for pair in all.windows(2) {
            for i in 0..=10 {
                let pose = checker
                    .frame
                    .interpolated(&pair[0], &pair[1], f64::from(i) / 10.0);
                assert_eq!(checker.penetration_depth(&pose, 1.0), 0.0);
            }
        }
    }
}
