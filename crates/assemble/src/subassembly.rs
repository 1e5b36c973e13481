//! Shapes that have been put together.

use std::sync::Arc;

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, MatingSearch, MatingSearchOptions};
use glam::DQuat;
use rayon::prelude::*;
use sdf_grid::TriangleMesh;

use crate::families::turned;
use crate::journal;
use crate::places::{Extension, Held, Known};
use crate::shape::Shape;

/// What it costs that parts of one shape are held in unlike ways, for every way beyond the first,
/// nats: equal parts have equal places.
const UNLIKE: f64 = 6.0;

/// What it costs that parts of one shape are turned differently, for every turn beyond the first, nats:
/// of what is as good otherwise, equal parts lie parallel. And what counts as parallel, radians.
const TURNED: f64 = 1.0;
const PARALLEL: f64 = 0.05;

/// What it may cost to set a part straight, nats.
const STRAIGHT: f64 = 3.0;

/// A shape in its place.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    /// Which shape.
    pub(crate) shape: usize,
    /// Which of its parts.
    pub(crate) member: usize,
    /// From the shape to the assembly.
    pub(crate) pose: Pose,
    /// The joint that held it when it was placed, assembly frame.
    pub(crate) joint: Joint,
    /// How contact held it then.
    pub(crate) held: Held,
}

/// Shapes in their places.
#[derive(Debug, Clone, Default)]
pub(crate) struct Subassembly {
    pub(crate) placed: Vec<Placed>,
    /// How well contact holds them, nats.
    pub(crate) score: f64,
    /// How much worse than in its best place on a single other one any part is held, nats.
    pub(crate) shortfall: f64,
    /// What could be added to it before its last parts were, if that is known.
    pub(crate) known: Option<Arc<Known>>,
}

impl Subassembly {
    /// A key of what can be added to it: of its parts and of what is known from when it had fewer.
    pub(crate) fn key(&self) -> String {
        let known = self.known.as_ref().map(|known| &known.key);
        let placed = |p: &Placed| (p.shape, p.member, p.pose);
        journal::key(&(known, self.placed.iter().map(placed).collect::<Vec<_>>()))
    }

    /// Parts of a shape that are placed.
    pub(crate) fn count(&self, shape: usize) -> usize {
        self.placed.iter().filter(|p| p.shape == shape).count()
    }

    /// The members of a shape that are not placed.
    pub(crate) fn free(&self, shape: usize, shapes: &[Shape]) -> Vec<usize> {
        let used = |m: &usize| {
            let mut placed = self.placed.iter();
            placed.any(|p| (p.shape, p.member) == (shape, *m))
        };
        (0..shapes[shape].parts.len())
            .filter(|m| !used(m))
            .collect()
    }

    /// With more parts of a shape, at these poses.
    pub(crate) fn with(
        &self,
        extension: &Extension,
        members: &[usize],
        places: &[(Pose, Joint)],
        shapes: &[Shape],
    ) -> Self {
        let (shape, held) = (extension.shape, extension.held);
        let mut grown = self.clone();
        for (member, (pose, joint)) in members.iter().zip(places) {
            grown.placed.push(Placed {
                shape,
                member: *member,
                pose: *pose,
                joint: joint.clone(),
                held,
            });
            grown.score += held.rank;
        }
        grown.score -= grown.disorder(shape, shapes) - self.disorder(shape, shapes);
        grown
    }

    /// What it costs that parts of a shape are held, or turned, in more than one way, nats.
    fn disorder(&self, shape: usize, shapes: &[Shape]) -> f64 {
        let mut ways: Vec<Held> = Vec::new();
        let mut turns: Vec<(Pose, Joint)> = Vec::new();
        for placed in self.placed.iter().filter(|p| p.shape == shape) {
            if !ways.iter().any(|way| way.is_like(&placed.held)) {
                ways.push(placed.held);
            }
            let symmetries = &shapes[shape].symmetries;
            let parallel =
                |other: &(Pose, Joint)| turned(other, &placed.pose, symmetries) < PARALLEL;
            if !turns.iter().any(parallel) {
                turns.push((placed.pose, placed.joint.clone()));
            }
        }
        let beyond = |count: usize| count.saturating_sub(1) as f64;
        UNLIKE * beyond(ways.len()) + TURNED * beyond(turns.len())
    }

    /// The same with what contact with all the others says of each part, whichever came first: how
    /// well it holds the part, summed.
    pub(crate) fn as_a_whole(&self, shapes: &[Shape], clearance: Option<f64>) -> Self {
        let meshes = self.meshes(shapes);
        let held = |i: usize| {
            let rest = all_but(&meshes, i);
            let search = MatingSearch::new(&rest, &meshes[i], options(clearance));
            let found = search.measure(&Pose::IDENTITY);
            Held {
                rank: found.rank,
                share: found.hold.share,
            }
        };
        let mut whole = self.clone();
        whole.known = None;
        let held: Vec<Held> = (0..meshes.len()).into_par_iter().map(held).collect();
        for (placed, held) in whole.placed.iter_mut().zip(&held) {
            placed.held = *held;
        }
        let disorder: f64 = (0..shapes.len()).map(|s| whole.disorder(s, shapes)).sum();
        // Every contact holds two parts.
        let ranks = held.iter().map(|h| h.rank);
        whole.score = 0.5 * ranks.sum::<f64>() - disorder;
        whole
    }

    /// The same with every part that may turn, from the `known` first ones on, turned so that its
    /// planes are parallel to those of the parts that may not turn or were turned before, an equal part
    /// first, where all others hold it about as well: a leg in its thread.
    pub(crate) fn straight(&self, shapes: &[Shape], clearance: Option<f64>, known: usize) -> Self {
        let mut meshes = self.meshes(shapes);
        let mut straight = self.clone();
        // The joint that held a part when it was placed may be another by now; none of parts that
        // do not turn.
        let turning = |i: usize| {
            let rest = all_but(&meshes, i);
            let search = MatingSearch::new(&rest, &meshes[i], options(clearance));
            let joint = || search.describe(&[Pose::IDENTITY]).pop().map(|h| h.joint);
            let free = i >= known.max(1);
            free.then(joint).flatten().filter(|j| j.kind.turns())
        };
        let mut turning: Vec<Option<Joint>> =
            (0..meshes.len()).into_par_iter().map(turning).collect();
        for i in 0..meshes.len() {
            let Some(joint) = turning[i].take() else {
                continue;
            };
            let rest = all_but(&meshes, i);
            let full = MatingSearch::new(&rest, &meshes[i], options(clearance));
            let set: Vec<usize> = (0..meshes.len())
                .filter(|k| *k != i && turning[*k].is_none())
                .collect();
            let already = TriangleMesh::joined(set.iter().map(|k| &meshes[*k]));
            let placed = &straight.placed[i];
            let equal = (set.iter().map(|k| &straight.placed[*k]))
                .filter(|other| other.shape == placed.shape)
                .find_map(|other| turn_to(&joint, placed, other));
            let options = MatingSearchOptions {
                present: equal,
                ..options(clearance)
            };
            let search = MatingSearch::new(&already, &meshes[i], options);
            let found = search.straight(&Pose::IDENTITY);
            let [before, after] = [Pose::IDENTITY, found.pose].map(|p| full.measure(&p).rank);
            let angle = found.pose.angle_to(&Pose::IDENTITY).to_degrees();
            tracing::debug!(shape = placed.shape, before, after, angle, "set straight");
            let placed = &mut straight.placed[i];
            if after > before - STRAIGHT {
                placed.pose = found.pose * placed.pose;
                placed.joint = found.joint;
                meshes[i] = moved(&shapes[placed.shape].mesh, &placed.pose);
            }
        }
        straight
    }

    /// The shapes that are placed, those first of which a part is held worst.
    pub(crate) fn shapes(&self) -> Vec<usize> {
        let mut shapes: Vec<usize> = self.placed.iter().map(|p| p.shape).collect();
        shapes.sort_unstable();
        shapes.dedup();
        let worst = |shape: &usize| {
            let of_shape = self.placed.iter().filter(|p| p.shape == *shape);
            of_shape.map(|p| p.held.rank).fold(f64::INFINITY, f64::min)
        };
        shapes.sort_by(|a, b| worst(a).total_cmp(&worst(b)));
        shapes
    }

    /// All surfaces as one.
    pub(crate) fn mesh(&self, shapes: &[Shape]) -> TriangleMesh {
        TriangleMesh::joined(&self.meshes(shapes))
    }

    /// The surfaces, each in its place.
    fn meshes(&self, shapes: &[Shape]) -> Vec<TriangleMesh> {
        let mesh = |p: &Placed| moved(&shapes[p.shape].mesh, &p.pose);
        self.placed.iter().map(mesh).collect()
    }
}

/// The turn about a joint that makes a part parallel to an equal one, if one does.
fn turn_to(joint: &Joint, part: &Placed, equal: &Placed) -> Option<Pose> {
    let between = equal.pose.rotation * part.pose.rotation.conjugate();
    let angle = 2.0 * between.xyz().dot(joint.axis).atan2(between.w);
    let turn = DQuat::from_axis_angle(joint.axis, angle);
    let parallel = turn.dot(between).abs() > (0.5 * PARALLEL).cos();
    parallel.then(|| Pose::new(turn, joint.point - turn * joint.point))
}

fn options(clearance: Option<f64>) -> MatingSearchOptions {
    MatingSearchOptions {
        clearance,
        ..MatingSearchOptions::default()
    }
}

/// All surfaces but one, as one.
fn all_but(meshes: &[TriangleMesh], one: usize) -> TriangleMesh {
    let others = meshes.iter().enumerate().filter(|(i, _)| *i != one);
    TriangleMesh::joined(others.map(|(_, mesh)| mesh))
}

/// A surface moved by a pose.
pub(crate) fn moved(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}

#[cfg(test)]
mod tests {
    use fft_correlate::mating::JointKind;
    use glam::DVec3;

    use super::*;

    /// About an axis that is not through the origin; a part that lies on its side has no such turn.
    #[test]
    fn a_turn_about_the_joint_makes_equal_parts_parallel() {
        let joint = Joint {
            kind: JointKind::Revolute,
            axis: DVec3::Y,
            point: DVec3::new(0.03, 0.0, -0.02),
            ..Joint::default()
        };
        let placed = |turn: DVec3| Placed {
            shape: 0,
            member: 0,
            pose: Pose::new(DQuat::from_scaled_axis(turn), DVec3::new(0.1, 0.2, 0.3)),
            joint: Joint::default(),
            held: Held::default(),
        };
        let (part, equal) = (placed(0.4 * DVec3::Y), placed(-0.9 * DVec3::Y));
        let turn = turn_to(&joint, &part, &equal).unwrap();
        let turned = turn * part.pose;
        assert!(turned.rotation.angle_between(equal.pose.rotation) < 1e-9);
        assert!(turn.apply(joint.point).distance(joint.point) < 1e-12);
        assert!(turn_to(&joint, &part, &placed(1.5 * DVec3::X)).is_none());
    }
}
