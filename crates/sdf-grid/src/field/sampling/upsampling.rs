//! Upsampling: densities of a fine lattice from those of a lattice of twice its spacing.
//!
//! Away from the boundary most densities vary so little from node to node that every second one
//! suffices and cubics interpolate the rest. Where they vary more, next to the boundary and on the
//! skeleton's sharp branches, the fine lattice is computed.

use ndarray::{Array3, s};
use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Arrays, BLOCK, Block, Grid, Region};
use crate::field::lattice::zeros;
use crate::field::options::DensityError;

/// Fine nodes per coarse node and axis.
pub(super) const FINE: usize = 2;

/// Coarse nodes before and behind those that are read, for fourth differences.
const BESIDE: i64 = 2;

/// Coarse nodes per axis that the interpolation of a block of eight fine nodes reads.
const READ: usize = 7;

/// Nodes nearer to the boundary than this many coarse spacings are never interpolated between.
const CLEAR: f32 = 2.0;

/// Largest fourth difference between coarse nodes, of the density of a half-space. Cubics are off
/// by a fortieth of it where the density is smooth, by 0.4 of it at the sharpest crease. It leaves
/// a relative L2 error of 2e-4 to 4e-4, far less than what the fine lattice itself is off.
const VARIATION: f32 = 0.35;

/// The densities of the coarse lattice, which covers the fine one.
pub(super) struct Upsampling {
    region: Region,
    /// Of the side that the node is on.
    density: Array3<Complex32>,
    sides: Array3<Side>,
}

/// What is known of a coarse node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Outside,
    Inside,
    /// Near the boundary, or the density varies too much.
    Rough,
}

/// Bytes per node while they are computed and while they are kept.
pub(super) const BYTES: usize = 2 * size_of::<Complex32>() + size_of::<f32>();

impl Upsampling {
    /// The coarse nodes for fine ones in whole blocks.
    pub(super) fn region(fine: &Region) -> Region {
        let half = |n: i64| n / FINE as i64;
        let first = fine.first.map(|n| half(n) - 1 - BESIDE);
        let last = (fine.last()).map(|n| half(n + 1 - BLOCK as i64) - 1 + READ as i64 - 1 + BESIDE);
        Region::between(first, last).in_blocks()
    }

    /// Computes the coarse densities for fine nodes with `sample`, which fills values at the nodes of
    /// `coarse` from one on; distances at `nodes`, which lie among them, go to `distance`. `typical`
    /// is a density of that kernel.
    pub(super) fn new(
        coarse: &Grid,
        fine: &Region,
        (nodes, distance): (&Region, &mut ndarray::ArrayViewMut3<'_, f32>),
        typical: f32,
        sample: impl FnOnce([i64; 3], Arrays<'_>) -> Result<(), DensityError>,
    ) -> Result<Self, DensityError> {
        let region = Self::region(fine);
        let memory = || DensityError::Memory {
            bytes: region.len().saturating_mul(BYTES as u64),
        };
        // The coarse nodes' arrays.
        let mut exterior: Array3<Complex32> = zeros(region.shape).ok_or_else(memory)?;
        let mut interior = zeros(region.shape).ok_or_else(memory)?;
        let mut signed = zeros(region.shape).ok_or_else(memory)?;
        let arrays = Arrays {
            exterior: exterior.view_mut(),
            interior: interior.view_mut(),
            signed_distance: signed.view_mut(),
        };
        // Their values.
        sample(region.first, arrays)?;
        exterior += &interior;
        // Distances where they are asked for, and where interpolation is safe.
        let own = |axis: usize| {
            let first = (nodes.first[axis] - region.first[axis]) as usize;
            first..first + nodes.shape[axis]
        };
        distance.assign(&signed.slice(s![own(0), own(1), own(2)]));
        let clear = CLEAR * coarse.spacing as f32;
        let sides = classify_nodes(&exterior, &signed, clear, VARIATION * typical);
        Ok(Self {
            region,
            density: exterior,
            sides,
        })
    }

    /// Fills a whole block of fine nodes, if all that is read for it is smooth; false if not.
    pub(super) fn fill(&self, block: &mut Block<'_>) -> bool {
        // The node before the block's first.
        let corner = block.place.corner;
        let first: [usize; 3] = std::array::from_fn(|axis| {
            (corner[axis] / FINE as i64 - 1 - self.region.first[axis]) as usize
        });
        let [x, y, z] = first.map(|n| n..n + READ);
        // All nodes that are read must be smooth and on one side.
        let sides = self.sides.slice(s![x.clone(), y.clone(), z.clone()]);
        let side = sides[[0, 0, 0]];
        if side == Side::Rough || sides.iter().any(|s| *s != side) {
            return false;
        }
        let part = match side {
            Side::Outside => &mut block.exterior,
            _ => &mut block.interior,
        };
        let (nx, ny, nz) = part.dim();
        // Interpolates along z, y and x.
        let mut planes = [[[Complex32::ZERO; 8]; 8]; READ];
        for (plane, from) in planes.iter_mut().zip(x) {
            let mut lines = [[Complex32::ZERO; 8]; READ];
            for (line, from_y) in lines.iter_mut().zip(y.clone()) {
                let row = self.density.slice(s![from, from_y, z.clone()]);
                *line = upsample(|k| row[k]);
            }
            let columns: [[Complex32; 8]; 8] = std::array::from_fn(|k| upsample(|j| lines[j][k]));
            *plane = std::array::from_fn(|j| std::array::from_fn(|k| columns[k][j]));
        }
        for j in 0..ny {
            for k in 0..nz {
                let along = upsample(|i| planes[i][j][k]);
                for (i, value) in along.iter().enumerate().take(nx) {
                    part[[i, j, k]] = *value;
                }
            }
        }
        true
    }
}

/// Eight fine values from seven coarse ones, of which the first lies before them. Next to a zero,
/// beyond the halo, there is nothing: fields end where they did.
fn upsample(coarse: impl Fn(usize) -> Complex32) -> [Complex32; 8] {
    std::array::from_fn(|f| {
        let at = |n: usize| coarse(f / 2 + n);
        match f % 2 {
            0 => at(1),
            _ if at(1) == Complex32::ZERO || at(2) == Complex32::ZERO => Complex32::ZERO,
            _ => (at(1) + at(2)) * 0.5625 - (at(0) + at(3)) * 0.0625,
        }
    })
}

/// Which nodes are clear of the boundary by `clear` and have densities whose fourth difference is
/// `most` at most.
fn classify_nodes(
    density: &Array3<Complex32>,
    signed: &Array3<f32>,
    clear: f32,
    most: f32,
) -> Array3<Side> {
    let most = most * most;
    let (nx, ny, nz) = density.dim();
    // Nodes and strides along the axes.
    let axes = [(nx, ny * nz), (ny, nz), (nz, 1)];
    let whole = "arrays that are not sliced are contiguous";
    let (density, signed) = (density.as_slice(), signed.as_slice());
    let (density, signed) = (density.expect(whole), signed.expect(whole));
    let mut sides = vec![Side::Rough; density.len()];
    let planes = sides.par_chunks_mut(ny * nz).enumerate();
    planes.for_each(|(x, plane)| {
        for (n, side) in plane.iter_mut().enumerate() {
            let (node, at) = (x * ny * nz + n, [x, n / nz, n % nz]);
            let is_smooth = || {
                at.into_iter().zip(axes).all(|(n, (nodes, stride))| {
                    // Nothing reads the nodes at the rim.
                    n < 2 || n + 2 >= nodes || fourth_difference(density, node, stride) <= most
                })
            };
            if signed[node].abs() >= clear && is_smooth() {
                *side = match signed[node] < 0.0 {
                    true => Side::Inside,
                    false => Side::Outside,
                };
            }
        }
    });
    Array3::from_shape_vec((nx, ny, nz), sides).expect("a side for each node")
}

/// The squared fourth difference about a node with two others on both sides, `stride` apart.
fn fourth_difference(values: &[Complex32], node: usize, stride: usize) -> f32 {
    let value = |shift: usize| values[node + shift * stride - 2 * stride];
    let outer = value(0) + value(4);
    let inner = value(1) + value(3);
    (outer - inner * 4.0 + value(2) * 6.0).norm_sqr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_refined_exactly() {
        let cubic = |x: f32| Complex32::new(x * x * x - 2.0 * x, 1.0 - 0.5 * x * x);
        // Coarse node n lies at fine place 2 (n - 1).
        let found = upsample(|n| cubic(2.0 * (n as f32 - 1.0)));
        for (f, v) in found.iter().enumerate() {
            // Values up to 343 in single precision.
            assert!((v - cubic(f as f32)).norm() < 1e-3, "{f}");
        }
    }
}
