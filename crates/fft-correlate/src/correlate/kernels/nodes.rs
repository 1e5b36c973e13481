//! Samples of a field by quadratic B-splines, eight at a time.

use fearless_simd::prelude::*;
use ndarray::Array3;
use num_complex::Complex;

use super::corners::{Cells, first_number};
use crate::correlate::real::Real;
use crate::vectors::transposed;
use sdf_grid::prefetch::fetch;

/// Numbers that one read brings: real and imaginary part at three nodes along z, and a fourth that
/// counts for nothing.
const READ: usize = 8;

/// A field's numbers, read at the 27 nodes around a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nodes<'a, T> {
    /// From the first node on, for three x and each three y: each begins later than the one before,
    /// and all end together.
    rows: [&'a [T]; 9],
}

impl<'a, T: Real> Nodes<'a, T> {
    /// Of a field in standard layout.
    pub(crate) fn new(values: &'a Array3<Complex<T>>) -> Self {
        let (_, ny, nz) = values.dim();
        let values = values.as_slice().expect("made in standard layout");
        let numbers: &[T] = bytemuck::cast_slice(values);
        let row = |n: usize| 2 * (n / 3 * ny * nz + n % 3 * nz);
        let rows = std::array::from_fn(|n| numbers.get(row(n)..).unwrap_or_default());
        Self { rows }
    }

    /// Asks for the values around places ahead of their use.
    #[inline(always)]
    pub(crate) fn ask_for<V>(self, cells: &[Cells<V>]) {
        for eight in cells {
            for place in &eight.places {
                // Neighbours ask for the others.
                for row in [self.rows[0], self.rows[4], self.rows[8]] {
                    fetch(row.as_ptr().wrapping_add(2 * *place as usize));
                }
            }
        }
    }

    /// Where the nodes around a place begin in each of the rows.
    #[inline(always)]
    fn start(self, place: i32) -> usize {
        // The last row is the shortest.
        first_number(place, READ, self.rows[8].len())
    }

    /// Real and imaginary parts of eight samples; `fractions` are distances from the middle nodes.
    ///
    /// # Panics
    /// If the nodes do not lie within the field.
    #[inline(always)]
    pub(crate) fn interpolated<S: Simd>(
        self,
        simd: S,
        cells: &Cells<T::Eight<S>>,
    ) -> [T::Eight<S>; 2] {
        let [fx, fy, fz] = cells.fractions;
        let (x, y, z) = (weights(simd, fx), weights(simd, fy), weights(simd, fz));
        let mut both = [fx; 9];
        for (n, weight) in both.iter_mut().enumerate() {
            *weight = x[n / 3] * y[n % 3];
        }
        // Of each sample real and imaginary parts at all z.
        let mut points = [fx; 8];
        for (p, point) in points.iter_mut().enumerate() {
            let at = self.start(cells.places[p]);
            let mut sum = T::Eight::<S>::splat(simd, T::zero());
            for (row, weight) in self.rows.iter().zip(&both) {
                // SAFETY: `start` left as many numbers in the last row, and no row is shorter.
                let numbers = unsafe { row.get_unchecked(at..at + READ) };
                let weight = T::Eight::<S>::splat(simd, weight.as_slice()[p]);
                sum = T::Eight::<S>::from_slice(simd, numbers).mul_add(weight, sum);
            }
            *point = sum;
        }
        let mut near = [points[0].split().0; 4];
        let (mut near_later, mut far, mut far_later) = (near, near, near);
        for p in 0..4 {
            (near[p], far[p]) = points[p].split();
            (near_later[p], far_later[p]) = points[p + 4].split();
        }
        let (near, near_later) = (transposed(near), transposed(near_later));
        let (far, far_later) = (transposed(far), transposed(far_later));
        let first = near[0].combine(near_later[0]) * z[0];
        let second = near[2].combine(near_later[2]).mul_add(z[1], first);
        let re = far[0].combine(far_later[0]).mul_add(z[2], second);
        let first = near[1].combine(near_later[1]) * z[0];
        let second = near[3].combine(near_later[3]).mul_add(z[1], first);
        [re, far[1].combine(far_later[1]).mul_add(z[2], second)]
    }
}

/// Weights of the nodes before, nearest to, and behind places at distance `t` from the nearest.
#[inline(always)]
fn weights<S: Simd, V: SimdFloat<S>>(simd: S, t: V) -> [V; 3]
where
    V::Element: Real,
{
    let half = V::splat(simd, Real::nearest(0.5));
    let (below, above) = (half - t, half + t);
    let middle = V::splat(simd, Real::nearest(0.75)) - t * t;
    [half * below * below, middle, half * above * above]
}
