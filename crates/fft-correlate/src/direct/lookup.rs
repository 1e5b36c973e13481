//! Sums of weighted points of one part, looked up in a blend of the other part's densities.

#![expect(
    clippy::needless_range_loop,
    reason = "lanes and axes index several arrays at once"
)]

use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x4, f32x8, i32x8};
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3};
use num_complex::Complex64;
use sdf_grid::DensityField;

use crate::direct::quadrature::Point;
use crate::direct::terms::Blend;
use crate::geometry::se3::Pose;
use crate::pair::interpolation::Interpolation;
use crate::vectors::{dispatch_lanes, inlined, transposed};

/// Layers of zeros around the values: in the outermost layer of cells value and gradient are zero,
/// so a point anywhere outside may be clamped into it.
const PAD: usize = 2;

/// Values on the smallest box of nodes that holds every non-zero one, padded with zeros;
/// real and imaginary parts interleaved, z fastest.
pub(super) struct LookupGrid {
    values: Vec<f32>,
    /// Padded nodes per axis.
    shape: [usize; 3],
    /// Where nodes are counted from, metres: the first of the part's whole lattice, whichever part of
    /// it is here, so that places round alike.
    anchor: DVec3,
    /// The first padded node, whole numbers.
    first: DVec3,
    /// Metres; the unit of the kernel's coordinates.
    spacing: f64,
    /// Spacing of the density's lattice, metres; the unit of point sets.
    cell: f64,
    interpolation: Interpolation,
}

impl LookupGrid {
    /// The largest number of padded nodes: offsets of the kernel are 32-bit.
    pub(super) const MAX_NODES: usize = (u32::MAX / 2) as usize;

    /// Grids for points that stand for single cells and for blocks of 2, 4, ... cells per side,
    /// `levels` in all; empty if there is nothing to look up. `anchor` is a node of the whole lattice,
    /// metres. The number of nodes if there are more than [`Self::MAX_NODES`].
    pub(super) fn pyramid(
        field: &DensityField,
        blend: Blend,
        levels: usize,
        interpolation: Interpolation,
        anchor: DVec3,
    ) -> Result<Vec<Self>, u64> {
        let Some(values) = Values::new(field, blend) else {
            return Ok(Vec::new());
        };
        let cell = Self::new(&values, field.lattice().spacing(), interpolation, anchor)?;
        let mut grids = vec![cell];
        for level in 1..levels {
            let smoothed = values.for_blocks(level, interpolation);
            grids.push(Self::new(
                &smoothed,
                field.lattice().spacing(),
                interpolation,
                smoothed.origin,
            )?);
        }
        Ok(grids)
    }

    fn new(
        values: &Values,
        cell: f64,
        interpolation: Interpolation,
        anchor: DVec3,
    ) -> Result<Self, u64> {
        let inner = values.shape;
        let shape = inner.map(|n| n + 2 * PAD);
        let nodes = shape.iter().map(|&n| n as u64).product::<u64>();
        if nodes > Self::MAX_NODES as u64 {
            return Err(nodes);
        }
        // Kernels read one node more than they use.
        let mut padded = vec![0.0; 2 * (nodes as usize + 1)];
        for i in 0..inner[0] {
            for j in 0..inner[1] {
                let from = 2 * (i * inner[1] + j) * inner[2];
                let to = 2 * (((i + PAD) * shape[1] + j + PAD) * shape[2] + PAD);
                let length = 2 * inner[2];
                padded[to..to + length].copy_from_slice(&values.values[from..from + length]);
            }
        }
        let spacing = values.stride as f64 * cell;
        Ok(Self {
            values: padded,
            shape,
            anchor,
            first: ((values.origin - anchor) / spacing).round() - PAD as f64,
            spacing,
            cell,
            interpolation,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.values.as_slice()) as u64
    }
}

/// Interleaved complex values on a box of nodes, before padding.
struct Values {
    values: Vec<f32>,
    shape: [usize; 3],
    origin: DVec3,
    /// Spacing in cells of the density's lattice.
    stride: usize,
    /// Spacing of that lattice, metres.
    cell: f64,
}

impl Values {
    /// The smallest box that holds every non-zero node.
    fn new(field: &DensityField, blend: Blend) -> Option<Self> {
        let (first, last) = occupied(field, blend)?;
        let shape: [usize; 3] = std::array::from_fn(|a| last[a] - first[a] + 1);
        let mut values = Vec::with_capacity(2 * shape.iter().product::<usize>());
        let (e, n) = (blend.exterior as f32, blend.interior as f32);
        for i in first[0]..=last[0] {
            for j in first[1]..=last[1] {
                for k in first[2]..=last[2] {
                    let (o, v) = (field.exterior[[i, j, k]], field.interior[[i, j, k]]);
                    values.extend([e * o.re + n * v.re, e * o.im + n * v.im]);
                }
            }
        }
        Some(Self {
            values,
            shape,
            origin: field.lattice().position(first),
            stride: 1,
            cell: field.lattice().spacing(),
        })
    }

    /// The values that a point standing for a block of `2^level` cells per side should see: the
    /// mean over the block.
    fn for_blocks(&self, level: usize, interpolation: Interpolation) -> Self {
        let stride = 1 << (level - 1);
        let width = box_nodes(interpolation, stride);
        let mut out = Self {
            values: self.values.clone(),
            shape: self.shape,
            origin: self.origin,
            stride,
            cell: self.cell,
        };
        for axis in 0..3 {
            out.smooth(axis, stride, width);
        }
        out
    }

    /// Means over boxes of `width` nodes along `axis`, one every `stride` nodes.
    fn smooth(&mut self, axis: usize, stride: usize, width: usize) {
        let before = self.shape;
        let length = before[axis];
        // Box k covers nodes k stride - (width - 1) .. k stride, so the first holds node 0 only.
        let boxes = (length + width - 2) / stride + 1;
        self.shape[axis] = boxes;
        // Numbers between neighbours along the axis; everything before the axis repeats.
        let step = 2 * before[axis + 1..].iter().product::<usize>();
        let repeats: usize = before[..axis].iter().product();
        let mut out = vec![0.0f32; repeats * boxes * step];
        for r in 0..repeats {
            for k in 0..boxes {
                let nodes = (k * stride + 1).saturating_sub(width)..(k * stride + 1).min(length);
                let to = (r * boxes + k) * step;
                for node in nodes {
                    let from = (r * length + node) * step;
                    for c in 0..step {
                        out[to + c] += self.values[from + c] / width as f32;
                    }
                }
            }
        }
        self.values = out;
        self.origin[axis] -= 0.5 * (width - 1) as f64 * self.cell;
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

/// Nodes per side of the box of nodes over which a point sees the mean that stands for `2^level`
/// of them per side, when it looks at every `stride`-th node.
///
/// Interpolation at a spacing of `s` cells smooths with variance s²/6 per axis trilinearly, in the
/// mean over all places, s²/4 by B-splines; the block asks for `(4^level - 1) / 12` on top of
/// what reading single cells does. A box of n nodes makes up the difference:
/// `n² = 2 s² + 2`, or `s² + 3`. Cubes have isotropic covariance, so this holds for every
/// rotation between the two.
fn box_nodes(interpolation: Interpolation, stride: usize) -> usize {
    let squared = match interpolation {
        Interpolation::Trilinear => 2 * stride * stride + 2,
        Interpolation::Quadratic => stride * stride + 3,
    };
    (squared as f64).sqrt().round() as usize
}

/// The map from a point set's coordinates to places in a grid. Places are counted, in grid spacings,
/// from a node of the whole lattice next to where the set's centre lands: what a place rounds to does
/// not depend on which part of the lattice the grid holds.
struct Map {
    /// Rows of the rotation, times cells per grid spacing.
    rows: [[f32; 3]; 3],
    /// Where the set's centre lands, 0 ..= 1.
    centre: [f32; 3],
    /// The padded index of the node that places are counted from, whole numbers.
    base: [f32; 3],
    /// Cells per grid spacing.
    scale: f32,
}

/// Padded indices up to which single precision tells halves apart; farther nothing is in reach.
const FARTHEST: f64 = (1 << 22) as f64;

impl Map {
    /// None if the points are too far away to meet anything.
    fn new(points: &PointSet, grid: &LookupGrid, motion: &Pose) -> Option<Self> {
        let rotation = DMat3::from_quat(motion.rotation).transpose();
        let place = (motion.apply(points.centre) - grid.anchor) / grid.spacing;
        let node = place.floor();
        let base = node - grid.first;
        let scale = grid.cell / grid.spacing;
        // False for what is not a number.
        base.abs()
            .cmple(DVec3::splat(FARTHEST))
            .all()
            .then(|| Self {
                rows: [rotation.x_axis, rotation.y_axis, rotation.z_axis]
                    .map(|r| (scale * r).as_vec3().to_array()),
                scale: scale as f32,
                centre: (place - node).as_vec3().to_array(),
                base: base.as_vec3().to_array(),
            })
    }

    /// True if no point of the cluster can meet a non-zero value.
    #[inline(always)]
    fn misses(&self, cluster: &Cluster, grid: &LookupGrid) -> bool {
        // The first value stands at index PAD.
        let inside = (PAD as f64 - grid.interpolation.reach()) as f32;
        (0..3).any(|a| {
            let r = self.rows[a];
            let c = cluster.centre;
            let u = self.centre[a] + r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
            let last = (grid.shape[a] - 1) as f32;
            let (low, high) = (inside - self.base[a], last - inside - self.base[a]);
            let radius = self.scale * cluster.radius;
            u + radius < low || u - radius > high
        })
    }
}

/// Points of a block, kept as arrays of one coordinate each.
const LANES: usize = 16;
/// Blocks of a cluster, skipped together when the cluster is outside the lattice.
const CLUSTER: usize = 4;

/// Sixteen points: coordinates in cells from the set's centre, complex weights.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
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
#[derive(Clone)]
pub(super) struct PointSet {
    blocks: Vec<Block>,
    clusters: Vec<Cluster>,
    /// Metres, the part's frame.
    centre: DVec3,
}

impl PointSet {
    /// Packs groups of points (neighbours in a group near each other in space) for lattices of
    /// `spacing`; `centre` is a node in their middle, metres.
    pub(super) fn new(groups: &[&[Point]], centre: DVec3, spacing: f64) -> Self {
        let mut set = Self {
            blocks: Vec::new(),
            clusters: Vec::new(),
            centre,
        };
        for group in groups {
            for chunk in group.chunks(LANES * CLUSTER) {
                set.push_cluster(chunk, spacing);
            }
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

    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(self.blocks.as_slice()) + size_of_val(self.clusters.as_slice())) as u64
    }
}

/// Points that are placed together.
const EIGHT: usize = 8;

/// What eight points need. Along z, weights stand eight in a row like the numbers that one load
/// brings: real and imaginary part at three nodes, and a fourth that counts for nothing. Aligned, as
/// is then the stack, so that no vector crosses a cache line.
#[repr(C, align(64))]
struct QuadraticLanes {
    offset: [i32; EIGHT],
    /// Weights of the three nodes along x and y, and their derivatives.
    weight: [[[f32; EIGHT]; 3]; 2],
    slope: [[[f32; EIGHT]; 3]; 2],
    lever: [[f32; EIGHT]; 3],
    /// Weights of the real part's value, of its z derivative, and of the imaginary part's value.
    along: [[[f32; 8]; EIGHT]; 3],
}

#[simd]
fn sum_quadratic<S: Simd, const IMAGINARY: bool>(
    simd: S,
    points: &PointSet,
    grid: &LookupGrid,
    map: &Map,
    totals: &mut [f64; 8],
) {
    let mut lanes = QuadraticLanes {
        offset: [0; EIGHT],
        weight: [[[0.0; EIGHT]; 3]; 2],
        slope: [[[0.0; EIGHT]; 3]; 2],
        lever: [[0.0; EIGHT]; 3],
        along: [[[0.0; 8]; EIGHT]; 3],
    };
    for cluster in &points.clusters {
        if map.misses(cluster, grid) {
            continue;
        }
        let mut sums = [f32x8::splat(simd, 0.0); 8];
        for block in &points.blocks[cluster.first as usize..cluster.last as usize] {
            for first in (0..LANES).step_by(EIGHT) {
                place_quadratic::<S, IMAGINARY>(simd, block, first, grid.shape, map, &mut lanes);
                accumulate_quadratic::<S, IMAGINARY>(simd, &lanes, grid, &mut sums);
            }
        }
        for (total, sum) in totals.iter_mut().zip(sums) {
            let lanes: [f32; 8] = sum.into();
            *total += f64::from(lanes.iter().sum::<f32>());
        }
    }
}

/// Places eight of a block's points in the grid.
#[inline(always)]
fn place_quadratic<S: Simd, const IMAGINARY: bool>(
    simd: S,
    block: &Block,
    first: usize,
    shape: [usize; 3],
    map: &Map,
    lanes: &mut QuadraticLanes,
) {
    let splat = inlined(
        #[inline(always)]
        |v: f32| f32x8::splat(simd, v),
    );
    // Per axis: the place in the grid, its nearest node, and the weights of three nodes.
    let of = first..first + EIGHT;
    let x = f32x8::from_slice(simd, &block.position[0][of.clone()]);
    let y = f32x8::from_slice(simd, &block.position[1][of.clone()]);
    let z = f32x8::from_slice(simd, &block.position[2][of.clone()]);
    let half = splat(0.5);
    let mut offset = i32x8::splat(simd, 0);
    let strides = [shape[1] * shape[2], shape[2], 1];
    let (mut weights, mut slopes) = ([half; 3], [half; 3]);
    for a in 0..3 {
        let [rx, ry, rz] = map.rows[a];
        let r = splat(rx).mul_add(x, splat(ry).mul_add(y, splat(rz) * z));
        // Clamped to where the nodes read are still zeros.
        let (base, nodes) = (map.base[a], shape[a] as f32);
        let u = (r + splat(map.centre[a]))
            .max(splat(0.5 - base))
            .min(splat(nodes - 1.5 - base));
        let nearest = (u + half).floor().min(splat(nodes - 2.0 - base));
        let t = u - nearest;
        let (below, above) = (half - t, half + t);
        weights = [
            half * below * below,
            splat(0.75) - t * t,
            half * above * above,
        ];
        slopes = [splat(0.0) - below, splat(-2.0) * t, above];
        let node = (nearest + splat(base - 1.0)).to_int::<i32x8<S>>();
        offset += node * i32x8::splat(simd, 2 * strides[a] as i32);
        r.store_slice(&mut lanes.lever[a]);
        if a < 2 {
            for n in 0..3 {
                weights[n].store_slice(&mut lanes.weight[a][n]);
                slopes[n].store_slice(&mut lanes.slope[a][n]);
            }
        }
    }
    lanes.offset = offset.into();
    // Weights along z times the points' complex weights.
    let re = f32x8::from_slice(simd, &block.weight[0][of.clone()]);
    let im = f32x8::from_slice(simd, &block.weight[1][of]);
    let minus = splat(0.0) - im;
    along(simd, weights, [re, minus], &mut lanes.along[0]);
    along(simd, slopes, [re, minus], &mut lanes.along[1]);
    if IMAGINARY {
        along(simd, weights, [im, re], &mut lanes.along[2]);
    }
}

/// Products of the weights of three nodes with two numbers, point by point.
#[inline(always)]
fn along<S: Simd>(
    simd: S,
    nodes: [f32x8<S>; 3],
    numbers: [f32x8<S>; 2],
    points: &mut [[f32; 8]; EIGHT],
) {
    let zero = f32x4::splat(simd, 0.0);
    let [re, im] = numbers;
    let (re_a, re_a_later) = (re * nodes[0]).split();
    let (im_a, im_a_later) = (im * nodes[0]).split();
    let (re_b, re_b_later) = (re * nodes[1]).split();
    let (im_b, im_b_later) = (im * nodes[1]).split();
    let (re_c, re_c_later) = (re * nodes[2]).split();
    let (im_c, im_c_later) = (im * nodes[2]).split();
    let near = transposed([re_a, im_a, re_b, im_b]);
    let near_later = transposed([re_a_later, im_a_later, re_b_later, im_b_later]);
    let far = transposed([re_c, im_c, zero, zero]);
    let far_later = transposed([re_c_later, im_c_later, zero, zero]);
    for p in 0..4 {
        near[p].combine(far[p]).store_slice(&mut points[p]);
        near_later[p]
            .combine(far_later[p])
            .store_slice(&mut points[p + 4]);
    }
}

/// Adds eight points' weighted values, gradients and moments.
#[inline(always)]
fn accumulate_quadratic<S: Simd, const IMAGINARY: bool>(
    simd: S,
    lanes: &QuadraticLanes,
    grid: &LookupGrid,
    sums: &mut [f32x8<S>; 8],
) {
    let row = 2 * grid.shape[2];
    let plane = row * grid.shape[1];
    let zero = f32x8::splat(simd, 0.0);
    for v in 0..EIGHT {
        let values = &grid.values[lanes.offset[v] as u32 as usize..];
        let (mut value, mut dx, mut dy) = (zero, zero, zero);
        // Weighted sums over three nodes along x, then along y.
        for j in 0..3 {
            let (mut across, mut along) = (zero, zero);
            for i in 0..3 {
                let at = i * plane + j * row;
                let numbers = f32x8::from_slice(simd, &values[at..at + 8]);
                across = numbers.mul_add(f32x8::splat(simd, lanes.weight[0][i][v]), across);
                along = numbers.mul_add(f32x8::splat(simd, lanes.slope[0][i][v]), along);
            }
            let w = f32x8::splat(simd, lanes.weight[1][j][v]);
            value = across.mul_add(w, value);
            dx = along.mul_add(w, dx);
            dy = across.mul_add(f32x8::splat(simd, lanes.slope[1][j][v]), dy);
        }
        // Weights of value, z slope and imaginary part; the lever from the set's centre.
        let [weight, slope, imaginary] = &lanes.along;
        let weights = [
            f32x8::from_slice(simd, &weight[v]),
            f32x8::from_slice(simd, &slope[v]),
            f32x8::from_slice(simd, &imaginary[v]),
        ];
        let [x, y, z] = &lanes.lever;
        let lever = [
            f32x8::splat(simd, x[v]),
            f32x8::splat(simd, y[v]),
            f32x8::splat(simd, z[v]),
        ];
        add_lookup::<S, IMAGINARY>([value, dx, dy], weights, lever, sums);
    }
}

/// Per-lane quantities of one block, four copies each so that they line up with the four numbers
/// (re, im at z; re, im at z + 1) that one load brings. Aligned, as is then the stack, so that no
/// vector crosses a cache line.
#[repr(C, align(64))]
struct TrilinearLanes {
    offset: [u32; LANES],
    fraction: [[[f32; 4]; LANES]; 2],
    lever: [[[f32; 4]; LANES]; 3],
    /// Weights of the real part's value, of its z derivative, and of the imaginary part's value.
    weight: [[[f32; 4]; LANES]; 3],
}

#[simd]
fn sum_trilinear<S: Simd, const IMAGINARY: bool>(
    simd: S,
    points: &PointSet,
    grid: &LookupGrid,
    map: &Map,
    totals: &mut [f64; 8],
) {
    let mut lanes = TrilinearLanes {
        offset: [0; LANES],
        fraction: [[[0.0; 4]; LANES]; 2],
        lever: [[[0.0; 4]; LANES]; 3],
        weight: [[[0.0; 4]; LANES]; 3],
    };
    for cluster in &points.clusters {
        if map.misses(cluster, grid) {
            continue;
        }
        let mut sums = [f32x8::splat(simd, 0.0); 8];
        for block in &points.blocks[cluster.first as usize..cluster.last as usize] {
            place_trilinear::<IMAGINARY>(block, grid.shape, map, &mut lanes);
            accumulate_trilinear::<S, IMAGINARY>(simd, &lanes, grid, &mut sums);
        }
        for (total, sum) in totals.iter_mut().zip(sums) {
            let lanes: [f32; 8] = sum.into();
            *total += f64::from(lanes.iter().sum::<f32>());
        }
    }
}

/// Places a block's points in the grid.
#[inline(always)]
fn place_trilinear<const IMAGINARY: bool>(
    block: &Block,
    shape: [usize; 3],
    map: &Map,
    lanes: &mut TrilinearLanes,
) {
    // The cell of every point and the fraction within it.
    let [x, y, z] = &block.position;
    let mut lever = [[0.0f32; LANES]; 3];
    let mut cell = [[0u32; LANES]; 3];
    let mut fraction = [[0.0f32; LANES]; 3];
    for a in 0..3 {
        let row = map.rows[a];
        // Clamped into the middle of the outermost cells, where everything is zero.
        let base = map.base[a];
        let last = shape[a] as f32 - 1.5 - base;
        for v in 0..LANES {
            let r = row[0] * x[v] + row[1] * y[v] + row[2] * z[v];
            let u = (r + map.centre[a]).max(0.5 - base).min(last);
            lever[a][v] = r;
            let below = u.floor();
            cell[a][v] = (below + base) as i32 as u32;
            fraction[a][v] = u - below;
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

/// The two points `2 * pair` and `2 * pair + 1` of a per-lane quantity.
#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &[[f32; 4]; LANES], pair: usize) -> f32x8<S> {
    f32x8::from_slice(simd, lanes[2 * pair..2 * pair + 2].as_flattened())
}

/// Real and imaginary part at two z-neighbours, for two points.
#[inline(always)]
fn corner<S: Simd>(simd: S, values: &[f32], at: [usize; 2], offset: usize) -> f32x8<S> {
    let (a, b) = (at[0] + offset, at[1] + offset);
    let low = f32x4::from_slice(simd, &values[a..a + 4]);
    low.combine(f32x4::from_slice(simd, &values[b..b + 4]))
}

/// Adds a block's weighted values, gradients and moments, two points at a time.
#[inline(always)]
fn accumulate_trilinear<S: Simd, const IMAGINARY: bool>(
    simd: S,
    lanes: &TrilinearLanes,
    grid: &LookupGrid,
    sums: &mut [f32x8<S>; 8],
) {
    let row = 2 * grid.shape[2];
    let plane = row * grid.shape[1];
    let values = grid.values.as_slice();
    // Two points at a time: four corners of x and y, each with both neighbours along z.
    for pair in 0..LANES / 2 {
        let at = [
            lanes.offset[2 * pair] as usize,
            lanes.offset[2 * pair + 1] as usize,
        ];
        let c00 = corner(simd, values, at, 0);
        let c01 = corner(simd, values, at, row);
        let c10 = corner(simd, values, at, plane);
        let c11 = corner(simd, values, at, plane + row);
        let fx = load(simd, &lanes.fraction[0], pair);
        let fy = load(simd, &lanes.fraction[1], pair);
        let (dy0, dy1) = (c01 - c00, c11 - c10);
        let (low, high) = (fy.mul_add(dy0, c00), fy.mul_add(dy1, c10));
        let dx = high - low;
        let dy = fx.mul_add(dy1 - dy0, dy0);
        let value = fx.mul_add(dx, low);
        let [weight, slope, imaginary] = &lanes.weight;
        let weights = [
            load(simd, weight, pair),
            load(simd, slope, pair),
            load(simd, imaginary, pair),
        ];
        let [x, y, z] = &lanes.lever;
        let lever = [
            load(simd, x, pair),
            load(simd, y, pair),
            load(simd, z, pair),
        ];
        add_lookup::<S, IMAGINARY>([value, dx, dy], weights, lever, sums);
    }
}

/// Adds looked-up values with their x and y slopes to the sums of value (real, imaginary), gradient
/// and moment. `weights` are those of the real part's value, of its z slope (which the value's
/// numbers hold, too), and of the imaginary part's value.
#[inline(always)]
fn add_lookup<S: Simd, const IMAGINARY: bool>(
    [value, dx, dy]: [f32x8<S>; 3],
    weights: [f32x8<S>; 3],
    [rx, ry, rz]: [f32x8<S>; 3],
    sums: &mut [f32x8<S>; 8],
) {
    sums[0] = value.mul_add(weights[0], sums[0]);
    if IMAGINARY {
        sums[1] = value.mul_add(weights[2], sums[1]);
    }
    let (gx, gy, gz) = (dx * weights[0], dy * weights[0], value * weights[1]);
    sums[2] += gx;
    sums[3] += gy;
    sums[4] += gz;
    sums[5] = ry.mul_add(gz, sums[5] - rz * gy);
    sums[6] = rz.mul_add(gx, sums[6] - rx * gz);
    sums[7] = rx.mul_add(gy, sums[7] - ry * gx);
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

/// Sums `points`, moved by `motion` into the grid's frame, over `grid`; the imaginary part of the
/// score only if `IMAGINARY`.
pub(super) fn sum<const IMAGINARY: bool>(
    level: Level,
    points: &PointSet,
    grid: &LookupGrid,
    motion: &Pose,
) -> Sums {
    let Some(map) = Map::new(points, grid, motion) else {
        return Sums::default();
    };
    let mut totals = [0.0f64; 8];
    match grid.interpolation {
        Interpolation::Trilinear => dispatch_lanes!(level, simd =>
            sum_trilinear::<_, IMAGINARY>(simd, points, grid, &map, &mut totals)),
        Interpolation::Quadratic => dispatch_lanes!(level, simd =>
            sum_quadratic::<_, IMAGINARY>(simd, points, grid, &map, &mut totals)),
    }
    let [re, im, gx, gy, gz, mx, my, mz] = totals;
    // The kernel differentiates per grid spacing and takes levers, in that unit, about the set's
    // centre.
    let gradient = DVec3::new(gx, gy, gz) / grid.spacing;
    let lever = motion.rotation * points.centre;
    Sums {
        score: Complex64::new(re, im),
        gradient,
        moment: DVec3::new(mx, my, mz) + lever.cross(gradient),
    }
}
