//! Shapes: parts that are equal up to a motion.

use std::sync::Arc;

use fft_correlate::{Pose, symmetry_group};
use glam::DVec3;
use sdf_grid::{SurfaceFeatures, TriangleMesh, congruence, symmetry};

use crate::request::LoosePart;

/// Surfaces that differ by this share of the diagonal are equal.
const SAME: f64 = 1e-3;

/// A shape, and the parts that have it.
#[derive(Debug)]
pub(crate) struct Shape {
    /// Its surface: that of its first part, in that part's own frame.
    pub(crate) mesh: Arc<TriangleMesh>,
    /// Its parts.
    pub(crate) parts: Vec<Member>,
    /// Motions that map it onto itself, the identity first.
    pub(crate) symmetries: Vec<Pose>,
    /// Points and directions of the axes of its round surfaces.
    pub(crate) axes: Vec<(DVec3, DVec3)>,
}

/// A part of a shape.
#[derive(Debug)]
pub(crate) struct Member {
    /// Its number.
    pub(crate) part: usize,
    /// From the shape to the part's own frame.
    pub(crate) motion: Pose,
}

impl Shape {
    /// The shapes of some parts, in the order of their first parts.
    pub(crate) fn of(parts: &[LoosePart]) -> Vec<Self> {
        let mut shapes: Vec<Self> = Vec::new();
        for (part, loose) in parts.iter().enumerate() {
            let tolerance = SAME * loose.mesh.bounds().diagonal();
            let carried = |shape: &Self| congruence(&shape.mesh, &loose.mesh, tolerance);
            let known = (shapes.iter().enumerate()).find_map(|(i, s)| Some((i, carried(s)?)));
            match known {
                Some((i, (rotation, translation))) => shapes[i].parts.push(Member {
                    part,
                    motion: Pose::new(rotation, translation),
                }),
                None => shapes.push(Self {
                    mesh: Arc::clone(&loose.mesh),
                    parts: vec![Member {
                        part,
                        motion: Pose::IDENTITY,
                    }],
                    symmetries: symmetry_group(&symmetry::detect(&loose.mesh, tolerance)),
                    axes: (SurfaceFeatures::new(&loose.mesh).axes.iter())
                        .map(|axis| (axis.point, axis.direction))
                        .collect(),
                }),
            }
        }
        shapes
    }
}
