//! How far the surface is at least.

use glam::DVec3;
use rayon::prelude::*;

use super::grid::Grid;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// Cells along the longest side.
const CELLS: f64 = 32.0;

/// Distances of a surface on a coarse lattice.
#[derive(Debug, Clone)]
pub(super) struct Clearance {
    grid: Grid,
    size: DVec3,
    /// Cells per metre.
    per_metre: f64,
    /// By how much the lattice is larger than the surface.
    margin: f64,
    /// A lower bound on the distance of the surface from all places of each cell, metres.
    least: Vec<f32>,
}

impl Clearance {
    pub(super) fn new(mesh: &TriangleMesh, bvh: &Bvh, reach: f64) -> Self {
        let bounds: Aabb = mesh.bounds().grown(reach);
        let size = bounds.size();
        let cell = size.max_element() / CELLS;
        let shape = (size / cell).ceil().max(DVec3::ONE);
        let grid = Grid {
            low: bounds.min,
            edge: cell,
            shape: shape.to_array().map(|n| n as usize),
        };
        let least = (0..grid.count()).into_par_iter().map(|flat| {
            let distance = bvh.nearest(grid.middle(flat)).distance;
            // Half a diagonal; single precision rounds.
            ((distance - 0.87 * cell) * (1.0 - 1e-6)) as f32
        });
        Self {
            grid,
            size,
            per_metre: 1.0 / cell,
            margin: reach,
            least: least.collect(),
        }
    }

    /// A lower bound on the distance of the surface from a place, metres; infinite for what is no
    /// place.
    #[inline(always)]
    pub(super) fn from(&self, p: DVec3) -> f64 {
        let place = p - self.grid.low;
        let off = place - place.clamp(DVec3::ZERO, self.size);
        if off != DVec3::ZERO {
            let distance = off.length();
            return if distance.is_nan() {
                f64::INFINITY
            } else {
                self.margin + distance
            };
        }
        let index = (place * self.per_metre).to_array().map(|x| x as usize);
        let index = [0, 1, 2].map(|k| index[k].min(self.grid.shape[k] - 1));
        f64::from(self.least[self.grid.flat(index)])
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.least.as_slice())
    }
}
