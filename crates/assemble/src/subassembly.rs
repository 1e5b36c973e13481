//! Shapes that have been put together.

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use sdf_grid::TriangleMesh;

use crate::shape::Shape;

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
}

/// Shapes in their places.
#[derive(Debug, Clone, Default)]
pub(crate) struct Subassembly {
    pub(crate) placed: Vec<Placed>,
    /// How well contact holds them, nats.
    pub(crate) score: f64,
}

impl Subassembly {
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
        shape: usize,
        members: &[usize],
        places: &[(Pose, Joint)],
        rank: f64,
    ) -> Self {
        let mut grown = self.clone();
        for (member, (pose, joint)) in members.iter().zip(places) {
            grown.placed.push(Placed {
                shape,
                member: *member,
                pose: *pose,
                joint: joint.clone(),
            });
            grown.score += rank;
        }
        grown
    }

    /// All surfaces as one.
    pub(crate) fn mesh(&self, shapes: &[Shape]) -> TriangleMesh {
        let placed: Vec<TriangleMesh> = (self.placed.iter())
            .map(|p| moved(&shapes[p.shape].mesh, &p.pose))
            .collect();
        TriangleMesh::joined(&placed)
    }
}

/// A surface moved by a pose.
pub(crate) fn moved(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}
