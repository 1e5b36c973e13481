//! Weighted points of one part, in blocks that vectors hold.

use glam::DVec3;

use crate::direct::quadrature::Point;

/// Points of a block, kept as arrays of one coordinate each.
pub(super) const LANES: usize = 16;
/// Blocks of a cluster, skipped together when the cluster is outside the lattice.
const CLUSTER: usize = 4;

/// Sixteen points: coordinates in cells from the set's centre, complex weights.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
pub(super) struct Block {
    pub(super) position: [[f32; LANES]; 3],
    pub(super) weight: [[f32; LANES]; 2],
}

/// Neighbouring blocks within a ball (cells from the set's centre).
#[derive(Debug, Clone, Copy)]
pub(super) struct Cluster {
    pub(super) first: u32,
    pub(super) last: u32,
    pub(super) centre: [f32; 3],
    pub(super) radius: f32,
}

/// Weighted points of one part.
#[derive(Clone)]
pub(in crate::direct) struct PointSet {
    pub(super) blocks: Vec<Block>,
    pub(super) clusters: Vec<Cluster>,
    /// Metres, the part's frame.
    pub(super) centre: DVec3,
}

impl PointSet {
    /// Packs points (neighbours in the list near each other in space) for lattices of `spacing`.
    pub(in crate::direct) fn new(points: &[Point], spacing: f64) -> Self {
        let total: DVec3 = points.iter().map(|p| p.position).sum();
        let centre = total / points.len().max(1) as f64;
        let mut set = Self {
            blocks: Vec::with_capacity(points.len().div_ceil(LANES)),
            clusters: Vec::with_capacity(points.len().div_ceil(LANES * CLUSTER)),
            centre,
        };
        for chunk in points.chunks(LANES * CLUSTER) {
            set.push_cluster(chunk, spacing);
        }
        set
    }

    fn push_cluster(&mut self, points: &[Point], spacing: f64) {
        let local = |p: &Point| (p.position - self.centre) / spacing;
        let low = points.iter().map(local).reduce(DVec3::min);
        let high = points.iter().map(local).reduce(DVec3::max);
        let centre = 0.5 * (low.unwrap_or_default() + high.unwrap_or_default());
        let radius = points.iter().map(|p| local(p).distance(centre));
        let first = self.blocks.len();
        let mut blocks = Vec::with_capacity(CLUSTER);
        for chunk in points.chunks(LANES) {
            // Lanes without a point sit at the cluster's centre with weight zero.
            let mut block = Block {
                position: centre.as_vec3().to_array().map(|c| [c; LANES]),
                weight: [[0.0; LANES]; 2],
            };
            for (lane, p) in chunk.iter().enumerate() {
                let at = local(p).as_vec3().to_array();
                for (axis, coordinate) in block.position.iter_mut().zip(at) {
                    axis[lane] = coordinate;
                }
                block.weight[0][lane] = p.weight.re as f32;
                block.weight[1][lane] = p.weight.im as f32;
            }
            blocks.push(block);
        }
        self.clusters.push(Cluster {
            first: first as u32,
            last: (first + blocks.len()) as u32,
            centre: centre.as_vec3().to_array(),
            // A thousandth of a cell covers the rounding of the coordinates to f32.
            radius: radius.fold(0.0, f64::max) as f32 + 1e-3,
        });
        self.blocks.append(&mut blocks);
    }

    pub(in crate::direct) fn bytes(&self) -> u64 {
        (size_of_val(self.blocks.as_slice()) + size_of_val(self.clusters.as_slice())) as u64
    }
}
