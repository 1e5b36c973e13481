//! The transform side of windowed correlations: sums of products
//! `f[n] = Re sum_terms sum_i A_t[i] B_t[i - n]` for `n` in a window, with the `A_t` fixed once and
//! the `B_t` given anew for every rotation.
//!
//! Two ways to the same numbers: [`Fused`], lane-batched kernels of our own, for sizes whose prime
//! factors they know, and [`Reference`], rustfft and realfft line by line, for every other size and
//! as the measure of the first.

use std::ops::Range;

use fearless_simd::Level;
use fearless_simd::prelude::*;
use ndarray::{Array3, ArrayViewMut3};
use num_complex::Complex;

use crate::HalfTurn;
use crate::fused::{Fused, FusedScratch};
use crate::real::Real;
use crate::spectral_reference::{Reference, ReferenceScratch};

/// The moving field of one term, asked for line by line.
pub(crate) trait MovingRows<T: Real> {
    /// Where the field may be nonzero, as indices into the term's moving box.
    fn bounds(&self) -> [Range<usize>; 3];

    /// Writes the values with index `[x, y, z]`, z in the third range of `bounds`, to `row[z]`.
    /// Returns false, and may leave `row` as it is, when all are zero.
    fn fill(&self, x: usize, y: usize, row: &mut [Complex<T>]) -> bool;

    /// Writes the values of as many rows as a vector has lanes, from `[x, y, 0]` on, to
    /// `bundle`: per z the real parts, then the imaginary parts; rows beyond `bounds` may hold any
    /// finite values. Returns the range of z outside of which all values are zero.
    fn fill_lanes<S: Simd>(&self, simd: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize>;
}

/// The fixed field of one term in the periodic box.
pub(crate) struct FixedTerm<T> {
    /// `A` with `A[i]` at `i - i0`, where `i0` is the first moving index plus the first window
    /// index; scaled by everything the result is to be multiplied with.
    pub(crate) field: Array3<Complex<T>>,
    /// Shape of the term's moving box.
    pub(crate) moving_shape: [usize; 3],
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

/// Transforms, sizes and the spectra of the fixed fields.
pub(crate) enum Spectral<T: Real> {
    Fused(Box<Fused<T>>),
    Reference(Reference<T>),
}

/// Working memory of one thread.
pub(crate) enum SpectralScratch<T: Real> {
    Fused(FusedScratch<T>),
    Reference(ReferenceScratch<T>),
}

/// Which of the two ways to take.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Way {
    /// The kernels where they know the size, at this level; else the reference.
    Fastest(Level),
    #[cfg(test)]
    Reference,
}

impl Way {
    /// The kernels with what this machine has.
    pub(crate) fn native() -> Self {
        Self::Fastest(Level::new())
    }
}

/// Bytes that correlations of one size need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Memory {
    /// The fixed spectra.
    pub(crate) spectra: u64,
    /// One thread's scratch.
    pub(crate) scratch: u64,
    /// What half turns add to that.
    pub(crate) half_turns: u64,
}

/// What these sizes need.
pub(crate) fn memory<T: Real>(
    size: [usize; 3],
    window: [usize; 3],
    moving_shapes: &[[usize; 3]],
) -> Memory {
    if Fused::<T>::knows(size) {
        Fused::<T>::memory(Level::new(), size, window, moving_shapes)
    } else {
        Reference::<T>::memory(size, window, moving_shapes)
    }
}

impl<T: Real> Spectral<T> {
    /// Transforms the fixed fields, all of one shape, for a window of this shape. `half_turns` says
    /// that all moving boxes are one, symmetric about the pivot.
    pub(crate) fn new(
        way: Way,
        size: [usize; 3],
        window: [usize; 3],
        terms: Vec<FixedTerm<T>>,
        half_turns: bool,
    ) -> Self {
        match way {
            Way::Fastest(level) if Fused::<T>::knows(size) => {
                Self::Fused(Box::new(Fused::new(level, size, window, terms, half_turns)))
            }
            _ => Self::Reference(Reference::new(size, window, terms)),
        }
    }

    pub(crate) fn scratch(&self) -> SpectralScratch<T> {
        match self {
            Self::Fused(s) => SpectralScratch::Fused(s.scratch()),
            Self::Reference(s) => SpectralScratch::Reference(s.scratch()),
        }
    }

    /// Writes `f` at every window index, with the moving fields turned by each of `turns`, to the
    /// `outs`, whose shape is the window's. Without turns there is one output, of the fields as they
    /// are; what one turn gives does not depend on the others.
    ///
    /// # Panics
    /// If the number of fields or the shape of an output is not what was planned, the scratch is
    /// another one's, or there are turns that were not planned for.
    pub(crate) fn correlate<M: MovingRows<T>>(
        &self,
        moving: &[M],
        turns: &[HalfTurn],
        scratch: &mut SpectralScratch<T>,
        outs: &mut [ArrayViewMut3<T>],
    ) -> StageTimes {
        match (self, scratch) {
            (Self::Fused(s), SpectralScratch::Fused(scratch)) => {
                s.correlate(moving, turns, scratch, outs)
            }
            (Self::Reference(s), SpectralScratch::Reference(scratch)) => {
                assert!(turns.is_empty(), "half turns are not shared");
                s.correlate(moving, scratch, &mut outs[0])
            }
            _ => panic!("scratch of another correlator"),
        }
    }
}
