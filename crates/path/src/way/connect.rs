//! Round the outside from one pose in the open to another.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};

use crate::contact::gaps::Gaps;
use crate::search::escape::Exit;

/// Poses on the arc between two directions.
const ARC: usize = 24;

/// How far a way out goes on, straight, until the parts' extents are `room` metres apart.
pub(crate) fn leave(pose: &Pose, exit: &Exit, room: f64) -> Pose {
    Pose {
        translation: pose.translation + (exit.distance + room).max(0.0) * exit.direction,
        ..*pose
    }
}

/// From one pose outside to another: straight away from the fixed part, round it on a sphere on which
/// the parts cannot touch, turning meanwhile, and straight back. The ends are left out.
pub(crate) fn round_outside(gaps: &Gaps, from: (&Pose, &Exit), to: (&Pose, &Exit)) -> Vec<Pose> {
    let centre = gaps.fixed.bounds().center();
    let radius = 1.01 * (gaps.fixed.radius_about(centre) + gaps.frame.radius);
    let [a, b] = [from, to].map(|(pose, exit)| away(gaps, pose, exit.direction, centre, radius));
    let middle = |pose: &Pose| pose.apply(gaps.frame.centre) - centre;
    let (start, end) = (middle(&a), middle(&b));
    let arc = DQuat::from_rotation_arc(start.normalize(), end.normalize());
    let on_arc = |i: usize| {
        let share = i as f64 / ARC as f64;
        let length = start.length() + share * (end.length() - start.length());
        let place = centre + DQuat::IDENTITY.slerp(arc, share) * start.normalize() * length;
        let rotation = a.rotation.slerp(b.rotation, share);
        Pose::new(rotation, place - rotation * gaps.frame.centre)
    };
    std::iter::once(a)
        .chain((1..ARC).map(on_arc))
        .chain([b])
        .collect()
}

/// Along a direction out to a sphere.
fn away(gaps: &Gaps, pose: &Pose, direction: DVec3, centre: DVec3, radius: f64) -> Pose {
    let from = pose.apply(gaps.frame.centre) - centre;
    // |from + s direction| = radius; inside it there is one positive root.
    let along = from.dot(direction);
    let rest = radius * radius - from.length_squared();
    let way = if rest > 0.0 {
        (along * along + rest).sqrt() - along
    } else {
        0.0
    };
    Pose {
        translation: pose.translation + way * direction,
        ..*pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::body::Body;
    use sdf_grid::shapes;
    use std::sync::Arc;

    #[test]
    fn round_the_outside_nothing_touches() {
        let cube = shapes::cuboid(DVec3::splat(0.02)).unwrap();
        let rod = shapes::cuboid(DVec3::new(0.002, 0.002, 0.03)).unwrap();
        let gaps = Gaps::new(
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
        let way = round_outside(&gaps, (&above, &up), (&below, &down));
        let all = [&[above][..], &way, &[below]].concat();
        for pair in all.windows(2) {
            for i in 0..=10 {
                let pose = gaps
                    .frame
                    .interpolated(&pair[0], &pair[1], f64::from(i) / 10.0);
                assert_eq!(gaps.depth(&pose, 1.0), 0.0);
            }
        }
    }
}
