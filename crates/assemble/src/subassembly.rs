//! Shapes that have been put together.

use fft_correlate::Pose;
use fft_correlate::mating::{Joint, MatingSearch, MatingSearchOptions};
use rayon::prelude::*;
use sdf_grid::TriangleMesh;

use crate::shape::Shape;

/// What it costs that parts of one shape are held in unlike ways, for every way beyond the first,
/// nats: equal parts have equal places.
const UNLIKE: f64 = 6.0;

/// Parts are held alike if it is to within so much, nats.
const ALIKE: f64 = 1.5;

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
    /// How well contact held it then, nats.
    pub(crate) rank: f64,
}

/// Shapes in their places.
#[derive(Debug, Clone, Default)]
pub(crate) struct Subassembly {
    pub(crate) placed: Vec<Placed>,
    /// How well contact holds them, nats.
    pub(crate) score: f64,
    /// How much worse than in its best place on a single other one any part is held, nats.
    pub(crate) shortfall: f64,
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
                rank,
            });
            grown.score += rank;
        }
        grown.score -= UNLIKE * (grown.unlike(shape) - self.unlike(shape)) as f64;
        grown
    }

    /// Ways beyond the first in which parts of a shape are held.
    fn unlike(&self, shape: usize) -> usize {
        let of_shape = self.placed.iter().filter(|p| p.shape == shape);
        let mut ranks: Vec<f64> = of_shape.map(|p| p.rank).collect();
        ranks.sort_by(f64::total_cmp);
        let other = |pair: &&[f64]| pair[1] - pair[0] > ALIKE;
        ranks.windows(2).filter(other).count()
    }

    /// The same with what contact with all the others says of each part, whichever came first: how
    /// well it holds the part, summed.
    pub(crate) fn as_a_whole(&self, shapes: &[Shape], clearance: Option<f64>) -> Self {
        let meshes: Vec<TriangleMesh> = (self.placed.iter())
            .map(|p| moved(&shapes[p.shape].mesh, &p.pose))
            .collect();
        let held = |i: usize| {
            let others = meshes.iter().enumerate().filter(|(j, _)| *j != i);
            let rest = TriangleMesh::joined(others.map(|(_, mesh)| mesh));
            let options = MatingSearchOptions {
                clearance,
                ..MatingSearchOptions::default()
            };
            let search = MatingSearch::new(&rest, &meshes[i], options);
            search.measure(&Pose::IDENTITY).rank
        };
        let mut whole = self.clone();
        let ranks: Vec<f64> = (0..meshes.len()).into_par_iter().map(held).collect();
        for (placed, rank) in whole.placed.iter_mut().zip(&ranks) {
            placed.rank = *rank;
        }
        let unlike: usize = (0..shapes.len()).map(|s| whole.unlike(s)).sum();
        // Every contact holds two parts.
        whole.score = 0.5 * ranks.iter().sum::<f64>() - UNLIKE * unlike as f64;
        whole
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
