//! Samples of a field, eight at a time: trilinear, or by quadratic B-splines.

use fearless_simd::prelude::*;
use ndarray::Array3;
use num_complex::Complex;
use sdf_grid::prefetch::fetch;

use crate::correlate::real::Real;
use crate::vectors::transposed;

/// A field's numbers, read at the corners of cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrilinearReader<'a, T> {
    /// From the near and the far y of the near and the far x of the first cell on: each begins
    /// later than the one before, and all end together.
    rows: [&'a [T]; 4],
}

/// Eight samples before any value is read.
#[derive(Clone, Copy)]
pub(crate) struct Cells<V> {
    /// Where the first corner of each one's cell lies.
    pub(crate) places: [i32; 8],
    /// Places within the cells.
    pub(crate) fractions: [V; 3],
}

#[cold]
#[inline(never)]
fn out_of_bounds() -> ! {
    panic!("a sample beyond the field");
}

/// The first number of a node from which `count` numbers of a row of `length` are read.
///
/// # Panics
/// If they are not all in the row.
#[inline(always)]
pub(super) fn first_number(place: i32, count: usize, length: usize) -> usize {
    let at = 2 * place as u32 as usize;
    match length.checked_sub(count) {
        Some(last) if at <= last => at,
        _ => out_of_bounds(),
    }
}

impl<'a, T: Real> TrilinearReader<'a, T> {
    /// Of a field in standard layout.
    pub(crate) fn new(values: &'a Array3<Complex<T>>) -> Self {
        let (_, ny, nz) = values.dim();
        let values = values.as_slice().expect("made in standard layout");
        let numbers: &[T] = bytemuck::cast_slice(values);
        let rows = [0, nz, ny * nz, ny * nz + nz].map(|corner| &numbers[2 * corner..]);
        Self { rows }
    }

    /// Asks for the values of cells ahead of their use.
    #[inline(always)]
    pub(crate) fn ask_for<V>(self, cells: &[Cells<V>]) {
        // Two corners of four: neighbours ask for the others.
        let [near, _, _, far] = self.rows;
        for eight in cells {
            for place in &eight.places {
                let at = 2 * *place as usize;
                fetch(near.as_ptr().wrapping_add(at));
                fetch(far.as_ptr().wrapping_add(at));
            }
        }
    }

    /// Where the corners of a cell begin in each of the rows.
    #[inline(always)]
    fn start(self, place: i32) -> usize {
        // The last row is the shortest.
        first_number(place, 4, self.rows[3].len())
    }

    /// Real and imaginary parts of eight samples.
    ///
    /// # Panics
    /// If a cell does not lie within the field.
    #[inline(always)]
    pub(crate) fn interpolated<S: Simd>(
        self,
        simd: S,
        cells: &Cells<T::Eight<S>>,
    ) -> [T::Eight<S>; 2] {
        let one = T::Eight::<S>::splat(simd, T::one());
        let [fx, fy, fz] = cells.fractions;
        let (gx, gy) = (one - fx, one - fy);
        let weights = [gx * gy, gx * fy, fx * gy, fx * fy];
        // Of samples p and p + 4 real and imaginary part at both z.
        let mut points = [one; 4];
        for (p, point) in points.iter_mut().enumerate() {
            let (a, b) = (self.start(cells.places[p]), self.start(cells.places[p + 4]));
            for (i, (row, weights)) in self.rows.iter().zip(&weights).enumerate() {
                // SAFETY: `start` left four numbers in the last row, and no row is shorter.
                let [low, high] =
                    unsafe { [row.get_unchecked(a..a + 4), row.get_unchecked(b..b + 4)] };
                let (low, high) = (
                    T::Quad::from_slice(simd, low),
                    T::Quad::from_slice(simd, high),
                );
                let value = low.combine(high);
                let weights = weights.as_slice();
                let a = T::Quad::<S>::splat(simd, weights[p]);
                let b = T::Quad::<S>::splat(simd, weights[p + 4]);
                let weight: T::Eight<S> = a.combine(b);
                *point = if i == 0 {
                    value * weight
                } else {
                    value.mul_add(weight, *point)
                };
            }
        }
        let mut low = [points[0].split().0; 4];
        let mut high = low;
        for p in 0..4 {
            (low[p], high[p]) = points[p].split();
        }
        let (low, high) = (transposed(low), transposed(high));
        let (re0, im0) = (low[0].combine(high[0]), low[1].combine(high[1]));
        let (re1, im1) = (low[2].combine(high[2]), low[3].combine(high[3]));
        [fz.mul_add(re1 - re0, re0), fz.mul_add(im1 - im0, im0)]
    }
}

/// Numbers that one read brings: real and imaginary part at three nodes along z, and a fourth that
/// counts for nothing.
const READ: usize = 8;

/// A field's numbers, read at the 27 nodes around a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct QuadraticReader<'a, T> {
    /// From the first node on, for three x and each three y: each begins later than the one before,
    /// and all end together.
    rows: [&'a [T]; 9],
}

impl<'a, T: Real> QuadraticReader<'a, T> {
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
