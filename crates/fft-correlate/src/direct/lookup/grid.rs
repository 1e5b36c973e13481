//! A blend of one part's densities on its lattice, padded with zeros, ready to be looked up.

use glam::DVec3;
use sdf_grid::DensityField;

use crate::direct::terms::Blend;
use crate::pair::reading::Reading;

/// Layers of zeros around the values: in the outermost layer of cells value and gradient are zero,
/// so a point anywhere outside may be clamped into it.
pub(super) const PAD: usize = 2;

/// Values on the smallest box of nodes that holds every non-zero one, padded with zeros;
/// real and imaginary parts interleaved, z fastest.
pub(in crate::direct) struct LookupGrid {
    pub(super) values: Vec<f32>,
    /// Padded nodes per axis.
    pub(super) shape: [usize; 3],
    /// Position of the first padded node, metres.
    pub(super) origin: DVec3,
    /// Metres; the unit of the kernel's coordinates.
    pub(super) spacing: f64,
    /// Spacing of the density's lattice, metres; the unit of point sets.
    pub(super) cell: f64,
    pub(super) reading: Reading,
}

impl LookupGrid {
    /// The largest number of padded nodes: offsets of the kernel are 32-bit.
    pub(in crate::direct) const MAX_NODES: usize = (u32::MAX / 2) as usize;

    /// Grids for points that stand for single cells and for blocks of 2, 4, ... cells per side,
    /// `levels` in all; empty if there is nothing to look up. The number of nodes if there are
    /// more than [`Self::MAX_NODES`].
    pub(in crate::direct) fn pyramid(
        field: &DensityField,
        blend: Blend,
        levels: usize,
        reading: Reading,
    ) -> Result<Vec<Self>, u64> {
        let Some(values) = Values::new(field, blend) else {
            return Ok(Vec::new());
        };
        let cell = Self::new(&values, field.lattice().spacing(), reading)?;
        let mut grids = vec![cell];
        for level in 1..levels {
            let smoothed = values.for_blocks(level, reading);
            grids.push(Self::new(&smoothed, field.lattice().spacing(), reading)?);
        }
        Ok(grids)
    }

    fn new(values: &Values, cell: f64, reading: Reading) -> Result<Self, u64> {
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
            origin: values.origin - spacing * PAD as f64,
            spacing,
            cell,
            reading,
        })
    }

    pub(in crate::direct) fn bytes(&self) -> u64 {
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
    fn for_blocks(&self, level: usize, reading: Reading) -> Self {
        let stride = 1 << (level - 1);
        let width = box_nodes(reading, stride);
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
/// Reading at a spacing of `s` cells smooths with variance s²/6 per axis trilinearly, in the
/// mean over all places, s²/4 by B-splines; the block asks for `(4^level - 1) / 12` on top of
/// what reading single cells does. A box of n nodes makes up the difference:
/// `n² = 2 s² + 2`, or `s² + 3`. Cubes have isotropic covariance, so this holds for every
/// rotation between the two.
fn box_nodes(reading: Reading, stride: usize) -> usize {
    let squared = match reading {
        Reading::Trilinear => 2 * stride * stride + 2,
        Reading::Quadratic => stride * stride + 3,
    };
    (squared as f64).sqrt().round() as usize
}
