//! Upsampling: densities of a fine lattice from those of a lattice of twice its spacing.
//!
//! Away from the boundary most densities vary so little from node to node that every second one
//! suffices and cubics interpolate the rest. Where they vary more, next to the boundary and on the
//! skeleton's sharp branches, the fine lattice is computed.

use glam::DVec3;
use ndarray::{Array3, Axis, s};
use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Arrays, Block};
use crate::field::lattice::{Lattice, zeros};
use crate::field::options::DensityError;

/// Fine nodes per coarse node and axis.
pub(super) const FINE: usize = 2;

/// Coarse nodes by which they begin before the fine lattice: what cubics and their test read.
const BEFORE: usize = 3;

/// Coarse nodes per axis that the interpolation of a block of eight fine nodes reads.
const READ: usize = 7;

/// Nodes nearer to the boundary than this many coarse spacings are never interpolated between.
const CLEAR: f32 = 2.0;

/// Largest fourth difference between coarse nodes, of the root mean square density. Cubics are off
/// by a fortieth of it where the density is smooth, by 0.4 of it at the sharpest crease. It leaves
/// a relative L2 error of 2e-4 to 4e-4, far less than what the fine lattice itself is off.
const VARIATION: f64 = 0.4;

/// The densities of the coarse lattice, which covers the fine one.
pub(super) struct Upsampling {
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
    /// The coarse lattice for a fine one of so many nodes.
    pub(super) fn shape(fine: [usize; 3]) -> [usize; 3] {
        // To the last node that the last block reads, and as far beyond as before.
        fine.map(|n| 4 * n.div_ceil(8) + READ - 4 + 2 * (BEFORE - 1))
    }

    /// Computes the coarse densities with `sample`, which fills the values of a lattice at its
    /// nodes; distances at the nodes of `lattice` go to `distance`. The fine lattice has `fine`
    /// nodes from `margin` of them before those of `lattice` on, a multiple of [`FINE`].
    pub(super) fn new(
        lattice: &Lattice,
        margin: usize,
        fine: [usize; 3],
        distance: &mut ndarray::ArrayViewMut3<'_, f32>,
        sample: impl FnOnce(&Lattice, Arrays<'_>) -> Result<(), DensityError>,
    ) -> Result<Self, DensityError> {
        let (h, before) = (lattice.spacing(), BEFORE + margin / FINE);
        let shape = Self::shape(fine);
        let memory = || DensityError::Memory {
            bytes: shape
                .iter()
                .fold(BYTES as u64, |b, n| b.saturating_mul(*n as u64)),
        };
        // The coarse lattice and its arrays.
        let origin = lattice.origin() - DVec3::splat(before as f64 * h);
        let coarse = Lattice::new(origin, h, shape).map_err(|_| memory())?;
        let mut exterior: Array3<Complex32> = zeros(&coarse).ok_or_else(memory)?;
        let mut interior = zeros(&coarse).ok_or_else(memory)?;
        let mut signed = zeros(&coarse).ok_or_else(memory)?;
        let arrays = Arrays {
            exterior: exterior.view_mut(),
            interior: interior.view_mut(),
            signed_distance: signed.view_mut(),
        };
        // Values at its nodes.
        sample(&coarse, arrays)?;
        exterior += &interior;
        // Distances of the nodes of `lattice`, and where interpolation is safe.
        let (nx, ny, nz) = distance.dim();
        let own = |n| before..before + n;
        distance.assign(&signed.slice(s![own(nx), own(ny), own(nz)]));
        let sides = classify_nodes(&exterior, &signed, CLEAR * h as f32);
        Ok(Self {
            density: exterior,
            sides,
        })
    }

    /// Fills a block of fine nodes, `start` from the first, if all that is read for it is smooth;
    /// false if not.
    pub(super) fn fill(&self, start: [usize; 3], block: &mut Block<'_>) -> bool {
        // The node before the block's first.
        let first = start.map(|f| f / FINE + BEFORE - 1);
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

/// Which nodes are clear of the boundary by `clear` and have densities that vary little.
fn classify_nodes(density: &Array3<Complex32>, signed: &Array3<f32>, clear: f32) -> Array3<Side> {
    let squares = |plane: ndarray::ArrayView2<'_, Complex32>| -> [f64; 2] {
        plane.iter().fold([0.0; 2], |[sum, count], v| {
            let square = f64::from(v.norm_sqr());
            [sum + square, count + f64::from(u8::from(square > 0.0))]
        })
    };
    let planes: Vec<_> = density.outer_iter().into_par_iter().map(squares).collect();
    let [sum, count] = planes
        .iter()
        .fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    let most = VARIATION * (sum / count.max(1.0)).sqrt();
    let most = (most * most) as f32;
    let mut sides = Array3::from_elem(density.dim(), Side::Rough);
    let planes = sides.axis_iter_mut(Axis(0)).into_par_iter().enumerate();
    planes.for_each(|(x, mut plane)| {
        for ((y, z), side) in plane.indexed_iter_mut() {
            let at = [x, y, z];
            let distance = signed[at];
            if distance.abs() >= clear && (0..3).all(|a| fourth_difference(density, at, a) <= most)
            {
                *side = match distance < 0.0 {
                    true => Side::Inside,
                    false => Side::Outside,
                };
            }
        }
    });
    sides
}

/// The squared fourth difference along an axis; of nodes at the rim, which nothing reads, none.
fn fourth_difference(density: &Array3<Complex32>, at: [usize; 3], axis: usize) -> f32 {
    if at[axis] < 2 || at[axis] + 2 >= density.shape()[axis] {
        return 0.0;
    }
    let value = |shift: usize| {
        let mut near = at;
        near[axis] = at[axis] + shift - 2;
        density[near]
    };
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
