//! Where points of one part lie in the lattice of the other.

use glam::DMat3;

use super::grid::{LookupGrid, PAD};
use super::points::{Cluster, PointSet};
use crate::geometry::se3::Pose;

/// The map from a point set's coordinates to a grid's padded fractional indices.
pub(super) struct Map {
    /// Rows of the rotation, times cells per grid spacing.
    pub(super) rows: [[f32; 3]; 3],
    /// Where the set's centre lands, padded fractional index.
    pub(super) centre: [f32; 3],
    /// Cells per grid spacing.
    pub(super) scale: f32,
}

impl Map {
    pub(super) fn new(points: &PointSet, grid: &LookupGrid, motion: &Pose) -> Self {
        let rotation = DMat3::from_quat(motion.rotation).transpose();
        let centre = (motion.apply(points.centre) - grid.origin) / grid.spacing;
        let scale = grid.cell / grid.spacing;
        Self {
            rows: [rotation.x_axis, rotation.y_axis, rotation.z_axis]
                .map(|r| (scale * r).as_vec3().to_array()),
            scale: scale as f32,
            centre: centre.as_vec3().to_array(),
        }
    }

    /// True if no point of the cluster can meet a non-zero value.
    #[inline(always)]
    pub(super) fn misses(&self, cluster: &Cluster, grid: &LookupGrid) -> bool {
        // The first value stands at index PAD.
        let inside = (PAD as f64 - grid.reading.reach()) as f32;
        (0..3).any(|a| {
            let r = self.rows[a];
            let c = cluster.centre;
            let u = self.centre[a] + r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
            let (low, high) = (inside, (grid.shape[a] - 1) as f32 - inside);
            let radius = self.scale * cluster.radius;
            u + radius < low || u - radius > high
        })
    }
}
