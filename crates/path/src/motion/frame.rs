//! Motions of a part about its centre, and how far they move it.

use std::f64::consts::PI;

use crate::motion::vec6::{Vec6, scaled};
use fft_correlate::Pose;
use glam::{DQuat, DVec3};

/// Directions in which a part's extreme vertices are found.
const DIRECTIONS: usize = 128;

/// A part's centre, size and outermost vertices, in its own frame; small motions are about its centre.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// Centroid of the solid, metres.
    pub(crate) centre: DVec3,
    /// Largest distance of a vertex from the centre, metres: turns times it are lengths.
    pub(crate) radius: f64,
    /// Vertices that are extreme in some direction, metres.
    pub(crate) extremes: Vec<DVec3>,
}

impl Frame {
    /// Of a part with this centre and these vertices, metres; there is one at least.
    pub(crate) fn new(centre: DVec3, vertices: &[DVec3]) -> Self {
        let mut extremes: Vec<usize> = directions(DIRECTIONS)
            .map(|u| extreme(vertices, u))
            .collect();
        extremes.sort_unstable();
        extremes.dedup();
        Self {
            centre,
            radius: vertices
                .iter()
                .map(|v| v.distance(centre))
                .fold(0.0, f64::max),
            extremes: extremes.iter().map(|i| vertices[*i]).collect(),
        }
    }

    /// Where a screw motion takes a part: a turn about an axis while it advances along it, its centre
    /// setting out with the motion's displacement.
    pub(crate) fn moved(&self, pose: &Pose, motion: &Vec6) -> Pose {
        let turn = self.turn(motion);
        let rotation = DQuat::from_scaled_axis(turn) * pose.rotation;
        let centre = pose.apply(self.centre) + advanced(turn, shift(motion));
        let rotation = rotation.normalize();
        Pose::new(rotation, centre - rotation * self.centre)
    }

    /// The screw motion of least turn from one pose to another.
    pub(crate) fn between(&self, from: &Pose, to: &Pose) -> Vec6 {
        let turn = from.twist_to(to).angular;
        let shift = to.apply(self.centre) - from.apply(self.centre);
        self.motion(turn, unadvanced(turn, shift))
    }

    /// The pose after a share of the screw motion between two.
    pub(crate) fn interpolated(&self, from: &Pose, to: &Pose, share: f64) -> Pose {
        self.moved(from, &scaled(&self.between(from, to), share))
    }

    /// The motion with this turn (a rotation vector) and displacement of the centre.
    pub(crate) fn motion(&self, turn: DVec3, shift: DVec3) -> Vec6 {
        let t = self.radius * turn;
        [t.x, t.y, t.z, shift.x, shift.y, shift.z]
    }

    pub(crate) fn turn(&self, motion: &Vec6) -> DVec3 {
        DVec3::new(motion[0], motion[1], motion[2]) / self.radius
    }

    /// The same screw where it has taken the centre from one place to another.
    pub(crate) fn carried(&self, motion: &Vec6, from: DVec3, to: DVec3) -> Vec6 {
        let turn = self.turn(motion);
        self.motion(turn, shift(motion) + turn.cross(to - from))
    }

    /// The largest motion of any point at the outset of a small motion from `pose`, metres.
    pub(crate) fn largest(&self, pose: &Pose, motion: &Vec6) -> f64 {
        let (turn, shift) = (self.turn(motion), shift(motion));
        let at = |p: &DVec3| shift + turn.cross(pose.rotation * (*p - self.centre));
        let squares = self.extremes.iter().map(|p| at(p).length_squared());
        squares.fold(0.0, f64::max).sqrt()
    }

    /// The largest distance between where two poses put a point, metres.
    pub(crate) fn apart(&self, a: &Pose, b: &Pose) -> f64 {
        let points = self.extremes.iter();
        let squares = points.map(|p| a.apply(*p).distance_squared(b.apply(*p)));
        squares.fold(0.0, f64::max).sqrt()
    }
}

/// The displacement of a motion's centre, metres.
pub(crate) fn shift(motion: &Vec6) -> DVec3 {
    DVec3::new(motion[3], motion[4], motion[5])
}

/// Where a screw takes a point that sets out with `shift` while the frame turns by `turn`.
fn advanced(turn: DVec3, shift: DVec3) -> DVec3 {
    let angle = turn.length();
    // The first terms of both series; the next are below rounding.
    let (a, b) = match angle < 1e-4 {
        true => (0.5, 1.0 / 6.0),
        false => (
            (1.0 - angle.cos()) / angle.powi(2),
            (angle - angle.sin()) / angle.powi(3),
        ),
    };
    let across = turn.cross(shift);
    shift + a * across + b * turn.cross(across)
}

/// With which displacement a point sets out that a screw takes this far; undoes [`advanced`].
fn unadvanced(turn: DVec3, shift: DVec3) -> DVec3 {
    let angle = turn.length();
    let c = match angle < 1e-3 {
        true => 1.0 / 12.0,
        false => (1.0 - 0.5 * angle / (0.5 * angle).tan()) / angle.powi(2),
    };
    let across = turn.cross(shift);
    shift - 0.5 * across + c * turn.cross(across)
}

/// Directions that lie evenly on the sphere, each with its opposite.
pub(crate) fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    let half = count / 2;
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..half).flat_map(move |i| {
        let z = (i as f64 + 0.5) / half as f64;
        let angle = golden * i as f64;
        let r = (1.0 - z * z).sqrt();
        let u = DVec3::new(r * angle.cos(), r * angle.sin(), z);
        [u, -u]
    })
}

fn extreme(points: &[DVec3], direction: DVec3) -> usize {
    let heights = points.iter().map(|p| p.dot(direction)).enumerate();
    let highest = heights.max_by(|a, b| a.1.total_cmp(&b.1));
    highest.map_or(0, |(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::vec6::length;
    use sdf_grid::shapes;

    #[test]
    fn motions_between_poses_lead_there_along_screws() {
        let mesh = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
        let mesh = mesh.transformed(DQuat::from_rotation_x(0.3), DVec3::new(0.1, -0.2, 0.3));
        let frame = Frame::new(mesh.centroid(), mesh.vertices());
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        let a = Pose::new(turn(0.3, -1.0, 0.5), DVec3::new(0.02, 0.01, -0.03));
        for angle in [0.0, 1e-6, 0.5, 2.9] {
            let b = Pose::new(
                turn(0.0, 0.6 * angle, -0.8 * angle) * a.rotation,
                a.translation + DVec3::new(0.004, 0.02, 0.01),
            );
            let motion = frame.between(&a, &b);
            let there = frame.moved(&a, &motion);
            assert!(frame.apart(&there, &b) < 1e-12, "{angle}");
            // Half of it, twice, carried along.
            let half = scaled(&motion, 0.5);
            let middle = frame.moved(&a, &half);
            let carried = frame.carried(&half, a.apply(frame.centre), middle.apply(frame.centre));
            assert!(
                frame.apart(&frame.moved(&middle, &carried), &b) < 1e-12,
                "{angle}"
            );
        }
        let small = frame.motion(DVec3::X * 1e-4, DVec3::Y * 1e-6);
        let moved = frame.moved(&a, &small);
        let found = frame.largest(&a, &small);
        assert!((found / frame.apart(&a, &moved) - 1.0).abs() < 1e-3);
        assert!(length(&small) > 0.0);
    }
}
