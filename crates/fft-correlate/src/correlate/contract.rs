//! The interface between the two sides of a correlation: sampling gives the moving fields' rows, the
//! kernels turn them into `f[n] = Re sum_terms sum_i A_t[i] B_t[i - n]` for `n` in a window.

use std::ops::Range;

use fearless_simd::prelude::*;

use super::real::Real;

/// The moving field of one term, asked for in bundles of lines along z.
pub(crate) trait MovingRows<T: Real> {
    /// Where the field may be nonzero, as indices into the term's moving box.
    fn bounds(&self) -> [Range<usize>; 3];

    /// Writes the values of as many rows as a vector has lanes, from `[x, y, 0]` on, to
    /// `bundle`: per z the real parts, then the imaginary parts; rows beyond `bounds` may hold any
    /// finite values. Returns the range of z outside of which all values are zero.
    fn fill_lanes<S: Simd>(&self, simd: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize>;
}

/// Shapes that a correlation is made for, in nodes along x, y, z.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sizes {
    /// Points of the transforms.
    pub(crate) transform: [usize; 3],
    /// Displacements.
    pub(crate) window: [usize; 3],
    /// The moving box of every term.
    pub(crate) moving: Vec<[usize; 3]>,
    /// Whether results for half turns are wanted; then all moving boxes are one, symmetric about
    /// the pivot.
    pub(crate) half_turns: bool,
}

/// Bytes that correlations of one size need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Memory {
    /// The fixed spectra.
    pub(crate) spectra: u64,
    /// What is held for a while beside them, as they are made one after the other.
    pub(crate) building: u64,
    /// One thread's scratch.
    pub(crate) scratch: u64,
}

/// Seconds that one call spent in its parts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// Sampling the moving fields at the nodes of the fixed lattice.
    pub resample: f64,
    /// z and y transforms of the moving fields.
    pub forward: f64,
    /// x transforms, products with the fixed spectra, x transforms back.
    pub product: f64,
    /// y and z transforms to scores.
    pub inverse: f64,
}

impl std::ops::AddAssign for StageTimes {
    fn add_assign(&mut self, other: Self) {
        self.resample += other.resample;
        self.forward += other.forward;
        self.product += other.product;
        self.inverse += other.inverse;
    }
}

impl StageTimes {
    /// All parts together.
    pub fn total(&self) -> f64 {
        self.resample + self.forward + self.product + self.inverse
    }
}
