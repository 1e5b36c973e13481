//! The kernels of the three stages, one plane or one block of columns at a time.
//!
//! # Safety
//! All memory is reached through [`Tile`]s, which check bounds in debug builds only: the tests run
//! every size and level with those checks. In release builds accesses are within bounds because
//! every buffer was laid out by [`super::Fused::scratch`] for the sizes that its own [`Layout`]
//! holds: bundles of `bundle` numbers, planes of `2 * bundles * row`, tiles of the longest line and
//! one block, half spectra of `spectra(planes)`. What is left to the caller is that the scratch is
//! borrowed and that no one else uses the plane or columns it names.
//!
//! [`Layout`]: super::layout::Layout

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::ArrayViewMut2;

use super::{Fused, PlaneScratch, Spectra};
use crate::lane_fft::transform;
use crate::lanes::{Strided, Tile, transpose};
use crate::radix::{inlined, mul};
use crate::real::Real;
use crate::spectral::MovingRows;

impl<T: Real> Fused<T> {
    /// The y line at `x` in the half spectra.
    ///
    /// # Safety
    /// `x` must be one of the planes.
    #[inline(always)]
    unsafe fn y_line(&self, of: &Spectra<T>, block: usize, part: usize, x: usize) -> Strided<T> {
        let l = &self.layout;
        let at = l.column(of.planes, block, part, 0) + x * l.x_stride;
        Strided {
            // SAFETY: as demanded.
            tile: unsafe { of.tile.from(at) },
            range: 0..self.size[1],
            bits: l.chunk_bits,
            far: l.chunk(of.planes),
            near: 2 * l.lanes,
        }
    }

    /// The x line at `y` in the half spectra.
    ///
    /// # Safety
    /// The range must lie within the planes.
    #[inline(always)]
    unsafe fn x_line(
        &self,
        of: &Spectra<T>,
        block: usize,
        part: usize,
        y: usize,
        range: Range<usize>,
    ) -> Strided<T> {
        let l = &self.layout;
        let at = l.column(of.planes, block, part, y) + range.start * l.x_stride;
        // SAFETY: as demanded.
        Strided::even(unsafe { of.tile.from(at) }, range, l.x_stride)
    }
}

/// Samples one x plane of a moving field.
#[simd]
pub(super) fn resample_plane<S: Simd, T: Real, M: MovingRows<T>>(
    simd: S,
    f: &Fused<T>,
    field: &M,
    x: usize,
    own: &mut PlaneScratch<T>,
) {
    let rows = field.bounds()[1].clone();
    let bundles = own.bundles.as_mut_slice().chunks_exact_mut(f.bundle);
    for ((b, bundle), filled) in bundles.enumerate().zip(&mut own.filled) {
        let y = rows.start + b * f.layout.lanes;
        if y >= rows.end {
            break;
        }
        *filled = field.fill_lanes(simd, x, y, bundle);
    }
}

/// Stage 1: one x plane of a moving field, y rows `rows`, to its half spectra over y and z.
///
/// # Safety
/// No one else may use plane `x` of the spectra.
#[simd]
pub(super) unsafe fn forward_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    x: usize,
    rows: Range<usize>,
    to: &Spectra<T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let (plane, bundles) = (own.plane.tile(), own.bundles.tile());
    let [a, b, lines, _] = &mut own.tiles;
    let (a, b, lines) = (a.tile(), b.tile(), lines.tile());
    let count = l.bundles(rows.len());
    for bundle in 0..count {
        // SAFETY: laid out so, see the module.
        let from = unsafe { bundles.from(bundle * f.bundle) };
        for part in 0..2 {
            // SAFETY: laid out so, see the module.
            let to = unsafe { plane.from((2 * bundle + part) * l.row) };
            // SAFETY: laid out so, see the module.
            unsafe { z_forward(simd, f, from, part, own.filled[bundle].clone(), to, [a, b]) };
        }
    }
    for block in 0..l.blocks {
        for part in 0..2 {
            for bundle in 0..count {
                let offset = (2 * bundle + part) * l.row + block * l.lanes * 2 * l.lanes;
                // SAFETY: laid out so, see the module.
                unsafe {
                    let from = plane.from(offset);
                    transpose_block(simd, from, lines.from(bundle * l.lanes * 2 * l.lanes));
                }
            }
            // SAFETY: laid out so, see the module.
            unsafe {
                let from = Strided::even(lines, rows.clone(), 2 * l.lanes);
                transform(simd, &f.y, [a, b], &from, &f.y_line(to, block, part, x));
            }
        }
    }
}

/// The half spectra of one part (0 real, 1 imaginary) of a bundle of lines that is zero outside
/// `filled`, written as a bundle.
///
/// # Safety
/// The bundle must hold the filled elements, `to` half the period, the tiles whatever `f` asks for;
/// no one else may use them.
#[inline(always)]
unsafe fn z_forward<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    from: Tile<T>,
    part: usize,
    filled: Range<usize>,
    to: Tile<T>,
    tiles: [Tile<T>; 2],
) {
    let half = f.layout.half;
    let lanes = f.layout.lanes;
    let zero = T::Native::<S>::splat(simd, T::zero());
    let store = inlined(
        #[inline(always)]
        // SAFETY: laid out so, see the module.
        |k: usize, v| unsafe { to.put(simd, k, v) },
    );
    if filled.is_empty() {
        for k in 0..half {
            store(k, [zero; 2]);
        }
        return;
    }
    let read = inlined(
        #[inline(always)]
        |z: usize| {
            if filled.contains(&z) {
                // SAFETY: laid out so, see the module.
                unsafe { from.load(simd, (2 * z + part) * lanes) }
            } else {
                zero
            }
        },
    );
    let twist = inlined(
        #[inline(always)]
        |z: usize| {
            let [cos, sin] = f.twist[z];
            [
                T::Native::<S>::splat(simd, cos),
                T::Native::<S>::splat(simd, sin),
            ]
        },
    );
    // SAFETY: as demanded.
    unsafe {
        let load = inlined(
            #[inline(always)]
            |z: usize| mul([read(z), read(z + half)], twist(z)),
        );
        f.z.process(simd, tiles, load, store);
    }
}

/// One block of elements, lanes of which become elements and the other way round.
///
/// # Safety
/// Both must hold as many elements as there are lanes; no one else may use them.
#[inline(always)]
unsafe fn transpose_block<S: Simd, T: Real>(simd: S, from: Tile<T>, to: Tile<T>) {
    let lanes = T::Native::<S>::LEN;
    // SAFETY: as demanded.
    unsafe {
        transpose(simd, from, 2 * lanes, to, 2 * lanes);
        transpose(simd, from.from(lanes), 2 * lanes, to.from(lanes), 2 * lanes);
    }
}

/// Stage 2: the x lines of one kz block and of the y in `rows`, for all terms; the sum's lines
/// replace those of the first term's real part.
///
/// # Safety
/// No one else may use these columns of the spectra.
#[simd]
pub(super) unsafe fn multiply_columns<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    rows: Range<usize>,
    spectra: &[Spectra<T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.size;
    let [work, re, im, sum] = &mut own.tiles;
    let (work, re, im) = (work.tile(), re.tile(), im.tile());
    let sum = if spectra.len() == 1 { re } else { sum.tile() };
    let zero = [T::Native::<S>::splat(simd, T::zero()); 2];
    for y in rows {
        let mut first = true;
        for (term, moving) in f.terms.iter().zip(spectra) {
            if moving.filled.is_empty() {
                continue;
            }
            for (part, to) in [re, im].into_iter().enumerate() {
                // SAFETY: laid out so, see the module.
                unsafe {
                    let from = f.x_line(moving, block, part, y, moving.filled.clone());
                    let to = Strided::even(to, 0..nx, 2 * l.lanes);
                    transform(simd, &f.x, f.x.tiles_to(to.tile, work), &from, &to);
                }
            }
            let fixed = &term.spectrum.as_slice()[(block * ny + y) * nx * 4 * l.lanes..];
            for (k, a) in fixed
                .chunks_exact(4 * T::Native::<S>::LEN)
                .take(nx)
                .enumerate()
            {
                let vector = inlined(
                    #[inline(always)]
                    |i: usize| T::Native::<S>::from_slice(simd, &a[i * l.lanes..][..l.lanes]),
                );
                // SAFETY: laid out so, see the module.
                let (br, bi) = unsafe { (re.get(simd, k), im.get(simd, k)) };
                let start = if first {
                    zero
                } else {
                    // SAFETY: laid out so, see the module.
                    unsafe { sum.get(simd, k) }
                };
                let v = add_mul(start, [vector(0), vector(1)], br);
                let v = add_mul(v, [vector(2), vector(3)], bi);
                // SAFETY: laid out so, see the module.
                unsafe { sum.put(simd, k, v) };
            }
            first = false;
        }
        // SAFETY: laid out so, see the module.
        unsafe {
            let from = Strided::even(sum, 0..nx, 2 * l.lanes);
            let to = f.x_line(&spectra[0], block, 0, y, 0..f.window[0]);
            transform(simd, &f.x, [sum, work], &from, &to);
        }
    }
}

/// Stage 3: one x plane of the sum to real values.
///
/// # Safety
/// No one else may write to the plane.
#[simd]
pub(super) unsafe fn inverse_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    x: usize,
    sum: &Spectra<T>,
    own: &mut PlaneScratch<T>,
    out: &mut ArrayViewMut2<'_, T>,
) {
    let l = f.layout;
    let plane = own.plane.tile();
    let [a, b, lines, real] = &mut own.tiles;
    let (a, b, lines, real) = (a.tile(), b.tile(), lines.tile(), real.tile());
    let [_, wy, wz] = f.window;
    let count = l.bundles(wy);
    for block in 0..l.blocks {
        // SAFETY: laid out so, see the module.
        unsafe {
            let to = Strided::even(lines, 0..wy, 2 * l.lanes);
            transform(simd, &f.y, [a, b], &f.y_line(sum, block, 0, x), &to);
        }
        for bundle in 0..count {
            let offset = 2 * bundle * l.row + block * l.lanes * 2 * l.lanes;
            // SAFETY: laid out so, see the module.
            unsafe {
                let from = lines.from(bundle * l.lanes * 2 * l.lanes);
                transpose_block(simd, from, plane.from(offset));
            }
        }
    }
    let row = wz.next_multiple_of(l.lanes);
    for bundle in 0..count {
        // SAFETY: laid out so, see the module.
        unsafe {
            let from = plane.from(2 * bundle * l.row);
            z_inverse(simd, f, from, lines, [a, b]);
            for z in (0..wz).step_by(l.lanes) {
                transpose(simd, lines.from(z * l.lanes), l.lanes, real.from(z), row);
            }
        }
        for lane in 0..l.lanes.min(wy - bundle * l.lanes) {
            // SAFETY: laid out so, see the module.
            let values = unsafe { real.slice(lane * row, wz) };
            let to = out.row_mut(bundle * l.lanes + lane);
            to.into_iter().zip(values).for_each(|(to, v)| *to = *v);
        }
    }
}

/// The real lines of a bundle of half spectra: one vector per wanted z.
///
/// # Safety
/// As [`z_forward`].
#[inline(always)]
unsafe fn z_inverse<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    from: Tile<T>,
    to: Tile<T>,
    tiles: [Tile<T>; 2],
) {
    let (half, wanted, lanes) = (f.layout.half, f.window[2], f.layout.lanes);
    let load = inlined(
        #[inline(always)]
        // SAFETY: laid out so, see the module.
        |k: usize| unsafe { from.get(simd, k) },
    );
    let store = inlined(
        #[inline(always)]
        |z: usize, [re, im]: [T::Native<S>; 2]| {
            if z < wanted {
                let [cos, sin] = f.twist[z];
                let (cos, sin) = (
                    T::Native::<S>::splat(simd, cos),
                    T::Native::<S>::splat(simd, sin),
                );
                // SAFETY: as demanded.
                unsafe { to.store::<S>(z * lanes, re.mul_sub(cos, im * sin)) };
                if z + half < wanted {
                    // SAFETY: as demanded.
                    unsafe { to.store::<S>((z + half) * lanes, -re.mul_add(sin, im * cos)) };
                }
            }
        },
    );
    // SAFETY: as demanded.
    unsafe { f.z.process(simd, tiles, load, store) };
}

/// `sum + a b`.
#[inline(always)]
fn add_mul<S: Simd, V: SimdFloat<S>>(sum: [V; 2], a: [V; 2], b: [V; 2]) -> [V; 2] {
    let re = a[0].mul_add(b[0], sum[0]);
    let im = a[0].mul_add(b[1], sum[1]);
    [a[1].mul_add(-b[1], re), a[1].mul_add(b[0], im)]
}
