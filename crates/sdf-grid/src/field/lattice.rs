//! A cubic lattice of points: the map between indices and metres. Holds no values.

use bytemuck::Zeroable;
use glam::{DVec3, UVec3};
use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::mesh::aabb::Aabb;
use crate::support::large;

/// Nodes `origin + spacing * (i, j, k)` with `0 <= (i, j, k) < shape`.
///
/// Arrays on a lattice are C-ordered with index `[i, j, k]` for x, y, z: z varies fastest.
/// Lattices made by [`Lattice::covering`] are cell-centred on the grid of multiples of `spacing`
/// (nodes at odd multiples of `spacing / 2`), so any two lattices of one spacing are aligned.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{Aabb, Lattice};
///
/// let bounds = Aabb { min: DVec3::splat(-0.01), max: DVec3::splat(0.01) };
/// // Cells of 1 mm that cover 2 mm more on every side.
/// let lattice = Lattice::covering(&bounds, 0.002, 0.001)?;
/// assert_eq!(lattice.shape(), [24; 3]);
/// assert!((lattice.position([0, 0, 0]).x + 0.0115).abs() < 1e-12);
/// assert!((lattice.fractional_index(DVec3::ZERO).x - 11.5).abs() < 1e-9);
/// # Ok::<(), sdf_grid::LatticeError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lattice {
    origin: [f64; 3],
    spacing: f64,
    shape: [usize; 3],
}

/// Why a lattice cannot be made.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum LatticeError {
    /// The spacing is not a positive finite number of metres.
    #[error("lattice spacing must be positive and finite, found {found} m")]
    Spacing {
        /// What was given, in metres.
        found: f64,
    },
    /// An origin or bound is not finite.
    #[error("lattice bounds must be finite, found {found}")]
    Bounds {
        /// What was given, in metres.
        found: DVec3,
    },
    /// An axis has no node, or the node count overflows the limit.
    #[error(
        "lattice of {} x {} x {} nodes: expected at least 1 per axis and at most {limit} in all",
        shape[0],
        shape[1],
        shape[2]
    )]
    Size {
        /// Nodes per axis asked for.
        shape: [f64; 3],
        /// The largest number of nodes accepted.
        limit: u64,
    },
}

impl Lattice {
    /// The largest number of nodes any lattice may have (2^33); memory checks come on top.
    pub const MAX_NODES: u64 = 1 << 33;

    /// A lattice with its first node at `origin` (metres).
    ///
    /// # Errors
    /// If the spacing is not positive and finite, the origin is not finite, an axis has no node,
    /// or there would be more than [`Lattice::MAX_NODES`] nodes.
    pub fn new(origin: DVec3, spacing: f64, shape: [usize; 3]) -> Result<Self, LatticeError> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(LatticeError::Spacing { found: spacing });
        }
        if !origin.is_finite() {
            return Err(LatticeError::Bounds { found: origin });
        }
        let nodes = shape.iter().try_fold(1u64, |n, &s| n.checked_mul(s as u64));
        match nodes {
            Some(n) if n > 0 && n <= Self::MAX_NODES => Ok(Self {
                origin: origin.to_array(),
                spacing,
                shape,
            }),
            _ => Err(LatticeError::Size {
                shape: shape.map(|s| s as f64),
                limit: Self::MAX_NODES,
            }),
        }
    }

    /// The smallest aligned, cell-centred lattice whose cells cover `bounds` grown by `margin`
    /// metres on every side.
    ///
    /// # Errors
    /// As [`Lattice::new`], and if the bounds or margin are not finite.
    pub fn covering(bounds: &Aabb, margin: f64, spacing: f64) -> Result<Self, LatticeError> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(LatticeError::Spacing { found: spacing });
        }
        let (lo, hi) = (bounds.min - margin, bounds.max + margin);
        for v in [lo, hi] {
            if !v.is_finite() {
                return Err(LatticeError::Bounds { found: v });
            }
        }
        // A bound within 1e-9 cells of a cell face counts as on it.
        let first = (lo / spacing + 1e-9).floor();
        let last = (hi / spacing - 1e-9).ceil();
        let cells = (last - first).max(DVec3::ONE);
        if cells.x * cells.y * cells.z > Self::MAX_NODES as f64 {
            return Err(LatticeError::Size {
                shape: cells.to_array(),
                limit: Self::MAX_NODES,
            });
        }
        Self::new(
            (first + 0.5) * spacing,
            spacing,
            cells.to_array().map(|c| c as usize),
        )
    }

    /// The part of it whose nodes lie in a box (metres); of a box beside it, or so thin that it holds no
    /// node, the nearest nodes.
    pub fn clipped(&self, to: &Aabb) -> Self {
        self.clipped_to_blocks(to, 1)
    }

    /// The same, of blocks of so many nodes per side, counted from the first, all that hold one.
    pub fn clipped_to_blocks(&self, to: &Aabb, nodes: u32) -> Self {
        let block = f64::from(nodes.max(1));
        let last = UVec3::from_array(self.shape.map(|s| s as u32 - 1)).as_dvec3();
        let index = |p: DVec3| self.fractional_index(p).clamp(DVec3::ZERO, last);
        let first = (index(to.min) - 1e-9).ceil().max(DVec3::ZERO);
        let end = (index(to.max) + 1e-9).floor().min(last).max(first);
        let first = block * (first / block).floor();
        let end = (block * (end / block).floor() + block - 1.0).min(last);
        Self {
            origin: (self.origin() + self.spacing * first).to_array(),
            spacing: self.spacing,
            shape: (end - first).to_array().map(|n| n as usize + 1),
        }
    }

    /// Position of node `[0, 0, 0]`, metres.
    pub fn origin(&self) -> DVec3 {
        DVec3::from_array(self.origin)
    }

    /// Distance between neighbouring nodes along each axis, metres.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Nodes along x, y, z.
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Always false: a lattice has at least one node.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Volume of one cell, cubic metres.
    pub fn cell_volume(&self) -> f64 {
        self.spacing.powi(3)
    }

    /// Position of node `index`, metres.
    pub fn position(&self, index: [usize; 3]) -> DVec3 {
        self.origin() + self.spacing * DVec3::from_array(index.map(|i| i as f64))
    }

    /// Fractional index of a position: node `[i, j, k]` maps to `(i, j, k)`.
    pub fn fractional_index(&self, position: DVec3) -> DVec3 {
        (position - self.origin()) / self.spacing
    }

    /// Index of a node from its place in C order.
    pub fn unravel(&self, flat: usize) -> [usize; 3] {
        let [_, ny, nz] = self.shape;
        [flat / (ny * nz), flat / nz % ny, flat % nz]
    }

    /// The box of node positions (half a cell smaller on each side than the cells), metres.
    pub fn node_bounds(&self) -> Aabb {
        let last = UVec3::from_array(self.shape.map(|s| s as u32)).as_dvec3() - 1.0;
        Aabb {
            min: self.origin(),
            max: self.origin() + self.spacing * last,
        }
    }
}

/// An array of zeros, or none if the memory cannot be had. Untouched: its pages are first written by
/// the threads that fill them.
pub(super) fn zeros<T: Zeroable>(shape: [usize; 3]) -> Option<Array3<T>> {
    let nodes = shape.iter().try_fold(1usize, |n, s| n.checked_mul(*s))?;
    let values = bytemuck::allocation::try_zeroed_vec(nodes).ok()?;
    large::ask_for_large_pages(&values);
    Array3::from_shape_vec(shape, values).ok()
}
