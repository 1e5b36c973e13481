//! A blend of one part's densities on its lattice, ready for fused trilinear lookups, and the
//! kernel that sums weighted points of the other part in it.

#![expect(
    clippy::needless_range_loop,
    reason = "lanes and axes index several arrays at once"
)]

use fearless_simd::{Level, dispatch, f32x4, f32x8, prelude::*};
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3};
use num_complex::Complex64;
use sdf_grid::DensityField;

use super::{plan::Blend, quadrature::Point};
use crate::Pose;

/// Layers of zeros around the values: in the outermost layer of cells value and gradient are zero,
/// so a point anywhere outside may be clamped into it.
const PAD: usize = 2;
/// Points of a block, kept as arrays of one coordinate each.
const LANES: usize = 16;
/// Blocks of a cluster, skipped together when the cluster is outside the lattice.
const CLUSTER: usize = 4;

/// Values on the smallest box of nodes that holds every non-zero one, padded with zeros;
/// real and imaginary parts interleaved, z fastest.
pub(super) struct LookupGrid {
    values: Vec<f32>,
    /// Padded nodes per axis.
    shape: [usize; 3],
    /// Position of the first padded node, metres.
    origin: DVec3,
    spacing: f64,
}

/// Sixteen points: coordinates in cells from the set's centre, complex weights.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
struct Block {
    position: [[f32; LANES]; 3],
    weight: [[f32; LANES]; 2],
}

/// Neighbouring blocks within a ball (cells from the set's centre).
#[derive(Debug, Clone, Copy)]
struct Cluster {
    first: u32,
    last: u32,
    centre: [f32; 3],
    radius: f32,
}

/// Weighted points of one part.
pub(super) struct PointSet {
    blocks: Vec<Block>,
    clusters: Vec<Cluster>,
    /// Metres, the part's frame.
    centre: DVec3,
    len: usize,
}

/// Sum of weighted lookups and its first derivatives, in the looked-up part's frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    /// `Σ w v`, with imaginary part only if asked for.
    pub(super) score: Complex64,
    /// `Re Σ w ∇v`, per metre.
    pub(super) gradient: DVec3,
    /// `Re Σ r × w ∇v`, r from the image of the points' frame origin.
    pub(super) moment: DVec3,
}

impl LookupGrid {
    /// The largest number of padded nodes: offsets of the kernel are 32-bit.
    pub(super) const MAX_NODES: usize = (u32::MAX / 2) as usize;

    /// None if there is nothing to look up; the shape may exceed [`Self::MAX_NODES`] only in the
    /// error.
    pub(super) fn new(field: &DensityField, blend: Blend) -> Result<Option<Self>, u64> {
        let Some((first, last)) = occupied(field, blend) else {
            return Ok(None);
        };
        let shape = [0, 1, 2].map(|a| last[a] - first[a] + 1 + 2 * PAD);
        let nodes = shape.iter().map(|&n| n as u64).product::<u64>();
        if nodes > Self::MAX_NODES as u64 {
            return Err(nodes);
        }
        let mut values = vec![0.0; 2 * nodes as usize];
        for i in first[0]..=last[0] {
            for j in first[1]..=last[1] {
                for k in first[2]..=last[2] {
                    let (o, v) = (field.exterior[[i, j, k]], field.interior[[i, j, k]]);
                    let (e, n) = (blend.exterior as f32, blend.interior as f32);
                    let x = (i - first[0] + PAD) * shape[1] + j - first[1] + PAD;
                    let at = 2 * (x * shape[2] + k - first[2] + PAD);
                    values[at] = e * o.re + n * v.re;
                    values[at + 1] = e * o.im + n * v.im;
                }
            }
        }
        let spacing = field.lattice.spacing();
        Ok(Some(Self {
            values,
            shape,
            origin: field.lattice.position(first) - spacing * PAD as f64,
            spacing,
        }))
    }

    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.values.as_slice()) as u64
    }
}

/// First and last index, per axis, of the nodes that contribute.
fn occupied(field: &DensityField, blend: Blend) -> Option<([usize; 3], [usize; 3])> {
    let (mut first, mut last) = ([usize::MAX; 3], [0; 3]);
    for ((i, j, k), _) in field.exterior.indexed_iter() {
        let index = [i, j, k];
        if !blend.is_zero_at(field, index) {
            for a in 0..3 {
                first[a] = first[a].min(index[a]);
                last[a] = last[a].max(index[a]);
            }
        }
    }
    (first[0] != usize::MAX).then_some((first, last))
}

impl PointSet {
    /// Packs points (neighbours in the list near each other in space) for lattices of `spacing`.
    pub(super) fn new(points: &[Point], spacing: f64) -> Self {
        let total: DVec3 = points.iter().map(|p| p.position).sum();
        let centre = total / points.len().max(1) as f64;
        let mut set = Self {
            blocks: Vec::with_capacity(points.len().div_ceil(LANES)),
            clusters: Vec::with_capacity(points.len().div_ceil(LANES * CLUSTER)),
            centre,
            len: points.len(),
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
                for a in 0..3 {
                    block.position[a][lane] = at[a];
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

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(self.blocks.as_slice()) + size_of_val(self.clusters.as_slice())) as u64
    }
}

/// The map from a point set's coordinates to a grid's padded fractional indices.
struct Map {
    /// Rows of the rotation.
    rows: [[f32; 3]; 3],
    /// Where the set's centre lands, padded fractional index.
    centre: [f32; 3],
}

impl Map {
    fn new(points: &PointSet, grid: &LookupGrid, motion: &Pose) -> Self {
        let rotation = DMat3::from_quat(motion.rotation).transpose();
        let centre = (motion.apply(points.centre) - grid.origin) / grid.spacing;
        Self {
            rows: [rotation.x_axis, rotation.y_axis, rotation.z_axis]
                .map(|r| r.as_vec3().to_array()),
            centre: centre.as_vec3().to_array(),
        }
    }

    /// True if no point of the cluster can meet a non-zero value.
    #[inline(always)]
    fn misses(&self, cluster: &Cluster, shape: [usize; 3]) -> bool {
        let inside = PAD as f32 - 1.0;
        (0..3).any(|a| {
            let r = self.rows[a];
            let c = cluster.centre;
            let u = self.centre[a] + r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
            let (low, high) = (inside, (shape[a] - 1) as f32 - inside);
            u + cluster.radius < low || u - cluster.radius > high
        })
    }
}

/// Sums `points`, moved by `motion` into the grid's frame, over `grid`; the imaginary part of the
/// score only if `IMAGINARY`.
pub(super) fn sum<const IMAGINARY: bool>(
    level: Level,
    points: &PointSet,
    grid: &LookupGrid,
    motion: &Pose,
) -> Sums {
    let map = Map::new(points, grid, motion);
    let mut totals = [0.0f64; 8];
    dispatch!(level, simd => sum_clusters::<_, IMAGINARY>(simd, points, grid, &map, &mut totals));
    let [re, im, gx, gy, gz, mx, my, mz] = totals;
    // The kernel differentiates per cell and takes levers in cells about the set's centre.
    let gradient = DVec3::new(gx, gy, gz) / grid.spacing;
    let lever = motion.rotation * points.centre;
    Sums {
        score: Complex64::new(re, im),
        gradient,
        moment: DVec3::new(mx, my, mz) + lever.cross(gradient),
    }
}

/// Per-lane quantities of one block, four copies each so that they line up with the four numbers
/// (re, im at z; re, im at z + 1) that one load brings.
struct Lanes {
    offset: [u32; LANES],
    fraction: [[[f32; 4]; LANES]; 2],
    lever: [[[f32; 4]; LANES]; 3],
    /// Weights of the real part's value, of its z derivative, and of the imaginary part's value.
    weight: [[[f32; 4]; LANES]; 3],
}

#[simd]
fn sum_clusters<S: Simd, const IMAGINARY: bool>(
    simd: S,
    points: &PointSet,
    grid: &LookupGrid,
    map: &Map,
    totals: &mut [f64; 8],
) {
    let mut lanes = Lanes {
        offset: [0; LANES],
        fraction: [[[0.0; 4]; LANES]; 2],
        lever: [[[0.0; 4]; LANES]; 3],
        weight: [[[0.0; 4]; LANES]; 3],
    };
    for cluster in &points.clusters {
        if map.misses(cluster, grid.shape) {
            continue;
        }
        let mut sums = [f32x8::splat(simd, 0.0); 8];
        for block in &points.blocks[cluster.first as usize..cluster.last as usize] {
            prepare::<IMAGINARY>(block, grid.shape, map, &mut lanes);
            accumulate::<S, IMAGINARY>(simd, &lanes, grid, &mut sums);
        }
        for (total, sum) in totals.iter_mut().zip(sums) {
            let lanes: [f32; 8] = sum.into();
            *total += f64::from(lanes.iter().sum::<f32>());
        }
    }
}

/// Places a block's points in the grid.
#[inline(always)]
fn prepare<const IMAGINARY: bool>(block: &Block, shape: [usize; 3], map: &Map, lanes: &mut Lanes) {
    let [x, y, z] = &block.position;
    let mut lever = [[0.0f32; LANES]; 3];
    let mut cell = [[0u32; LANES]; 3];
    let mut fraction = [[0.0f32; LANES]; 3];
    for a in 0..3 {
        let row = map.rows[a];
        // Clamped into the middle of the outermost cells, where everything is zero.
        let last = shape[a] as f32 - 1.5;
        for v in 0..LANES {
            let r = row[0] * x[v] + row[1] * y[v] + row[2] * z[v];
            let u = (r + map.centre[a]).max(0.5).min(last);
            lever[a][v] = r;
            cell[a][v] = u as i32 as u32;
            fraction[a][v] = u - cell[a][v] as i32 as f32;
        }
    }
    let (row, plane) = (shape[2] as u32, (shape[1] * shape[2]) as u32);
    for v in 0..LANES {
        lanes.offset[v] = 2 * (cell[0][v] * plane + cell[1][v] * row + cell[2][v]);
    }
    for v in 0..LANES {
        let (re, im, z) = (block.weight[0][v], block.weight[1][v], fraction[2][v]);
        lanes.weight[0][v] = [re * (1.0 - z), -im * (1.0 - z), re * z, -im * z];
        lanes.weight[1][v] = [-re, im, re, -im];
        if IMAGINARY {
            lanes.weight[2][v] = [im * (1.0 - z), re * (1.0 - z), im * z, re * z];
        }
    }
    for v in 0..LANES {
        for a in 0..2 {
            lanes.fraction[a][v] = [fraction[a][v]; 4];
        }
        for a in 0..3 {
            lanes.lever[a][v] = [lever[a][v]; 4];
        }
    }
}

/// Adds a block's weighted values, gradients and moments, two points at a time.
#[inline(always)]
fn accumulate<S: Simd, const IMAGINARY: bool>(
    simd: S,
    lanes: &Lanes,
    grid: &LookupGrid,
    sums: &mut [f32x8<S>; 8],
) {
    let row = 2 * grid.shape[2];
    let plane = row * grid.shape[1];
    let values = grid.values.as_slice();
    for pair in 0..LANES / 2 {
        let load = |array: &[[f32; 4]; LANES]| {
            let two = array[2 * pair..2 * pair + 2].as_flattened();
            f32x8::from_slice(simd, two)
        };
        let at = [lanes.offset[2 * pair], lanes.offset[2 * pair + 1]].map(|o| o as usize);
        let corner = |o: usize| {
            let four = |start: usize| f32x4::from_slice(simd, &values[start..start + 4]);
            four(at[0] + o).combine(four(at[1] + o))
        };
        let (c00, c01) = (corner(0), corner(row));
        let (c10, c11) = (corner(plane), corner(plane + row));
        let (fx, fy) = (load(&lanes.fraction[0]), load(&lanes.fraction[1]));
        let (dy0, dy1) = (c01 - c00, c11 - c10);
        let (low, high) = (fy.mul_add(dy0, c00), fy.mul_add(dy1, c10));
        let dx = high - low;
        let dy = fx.mul_add(dy1 - dy0, dy0);
        let value = fx.mul_add(dx, low);

        let weight = load(&lanes.weight[0]);
        let (gx, gy) = (dx * weight, dy * weight);
        let gz = value * load(&lanes.weight[1]);
        let [rx, ry, rz] = [0, 1, 2].map(|a| load(&lanes.lever[a]));
        sums[0] = value.mul_add(weight, sums[0]);
        if IMAGINARY {
            sums[1] = value.mul_add(load(&lanes.weight[2]), sums[1]);
        }
        sums[2] += gx;
        sums[3] += gy;
        sums[4] += gz;
        sums[5] = ry.mul_add(gz, sums[5] - rz * gy);
        sums[6] = rz.mul_add(gx, sums[6] - rx * gz);
        sums[7] = rx.mul_add(gy, sums[7] - ry * gx);
    }
}
