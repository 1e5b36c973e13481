//! The kernels of the three stages, one plane or one block of columns at a time.
//!
//! # Safety
//! All memory is reached through [`Tile`]s, which check bounds in debug builds only: the tests run
//! every size and level with those checks. In release builds accesses are within bounds because
//! every buffer was laid out by [`super::Fused::scratch`] for the sizes that its own [`Layout`]
//! holds: bundles of `bundle` numbers, planes of `2 * bundles * row`, tiles of the longest line and
//! one block, lines of `lines(planes)`, half spectra of `block(planes)`. What is left to the caller is that the scratch is
//! borrowed and that no one else uses the plane or columns it names.
//!
//! [`Layout`]: super::layout::Layout

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::ArrayViewMut2;

use super::images::{Image, Output, Sum};
use super::{Fused, MAX_TERMS, PlaneScratch, Spectra, Term};
use crate::lane_fft::{first_passes, transform};
use crate::lanes::{Line, Tile, transpose};
use crate::radix::{inlined, mul};
use crate::real::Real;
use crate::spectral::MovingRows;

/// The line of a column or row of half spectra that begins at `offset`.
///
/// # Safety
/// As [`Tile::from`].
#[inline(always)]
pub(super) unsafe fn line<T: Real>(of: Tile<T>, offset: usize, places: &[usize]) -> Line<'_, T> {
    // SAFETY: as demanded.
    let tile = unsafe { of.from(offset) };
    Line { tile, places }
}

/// Samples one x plane of a moving field, the `slot`th of those at hand.
#[simd]
pub(super) fn resample_plane<S: Simd, T: Real, M: MovingRows<T>>(
    simd: S,
    f: &Fused<T>,
    field: &M,
    x: usize,
    slot: usize,
    own: &mut PlaneScratch<T>,
) {
    let rows = field.bounds()[1].clone();
    let first = slot * f.plane_bundles;
    let bundles = own.bundles.as_mut_slice()[first * f.bundle..].chunks_exact_mut(f.bundle);
    for ((b, bundle), filled) in bundles.enumerate().zip(&mut own.filled[first..]) {
        let y = rows.start + b * f.layout.lanes;
        if y >= rows.end {
            break;
        }
        *filled = field.fill_lanes(simd, x, y, bundle);
    }
}

/// Stage 1: one x plane of a moving field, sampled to a slot, y rows `rows`, to its lines along y over kz.
///
/// # Safety
/// No one else may use plane `x` of the lines.
#[simd]
pub(super) unsafe fn forward_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    term: &Term<T>,
    [x, slot]: [usize; 2],
    rows: Range<usize>,
    to: &Spectra<'_, T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let (plane, bundles) = (own.plane.tile(), own.bundles.tile());
    let [a, b, ..] = &mut own.tiles;
    let (a, b) = (a.tile(), b.tile());
    let first = slot * f.plane_bundles;
    let count = l.bundles(rows.len());
    let real = term.moving_shape[2] <= l.half;
    for bundle in 0..count {
        let filled = own.filled[first + bundle].clone();
        for part in 0..2 {
            // SAFETY: laid out so, see the module.
            unsafe {
                let from = bundles.from((first + bundle) * f.bundle);
                let to = plane.from((2 * bundle + part) * l.row);
                z_forward(simd, f, from, part, filled.clone(), real, to, [a, b]);
            }
        }
    }
    let element = 2 * l.lanes;
    let zero = [T::Native::<S>::splat(simd, T::zero()); 2];
    for block in 0..l.blocks {
        for part in 0..2 {
            // SAFETY: laid out so, see the module.
            let line = unsafe { to.lines.from(l.line(to.planes, block, part, x)) };
            for bundle in 0..count {
                let offset = (2 * bundle + part) * l.row + block * l.lanes * element;
                // SAFETY: laid out so, see the module.
                unsafe {
                    let to = line.from((rows.start + bundle * l.lanes) * element);
                    transpose_block(simd, plane.from(offset), to);
                }
            }
            // Rows beyond the last one may hold anything.
            for y in (0..rows.start).chain(rows.end..l.line_elements) {
                // SAFETY: laid out so, see the module.
                unsafe { line.put(simd, y, zero) };
            }
        }
    }
}

/// The half spectra of one part (0 real, 1 imaginary) of a bundle of lines that is zero outside
/// `filled`, written as a bundle. `real` says that nothing lies beyond half of the period.
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
    real: bool,
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
        if real {
            let load = inlined(
                #[inline(always)]
                |z: usize| {
                    let (value, [cos, sin]) = (read(z), twist(z));
                    [value * cos, value * sin]
                },
            );
            f.z.process(simd, tiles, load, store);
        } else {
            let load = inlined(
                #[inline(always)]
                |z: usize| mul([read(z), read(z + half)], twist(z)),
            );
            f.z.process(simd, tiles, load, store);
        }
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

/// Stage 2: the y transforms of one kz block of all terms, to its half spectra.
///
/// # Safety
/// No one else may use the lines and the spectra.
#[simd]
pub(super) unsafe fn forward_block<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [a, b, ..] = &mut own.tiles;
    let (a, b) = (a.tile(), b.tile());
    for (term, moving) in f.terms.iter().zip(spectra) {
        for part in 0..2 {
            for x in moving.filled.clone() {
                let at = l.column(moving.planes, part, 0) + x * l.x_stride;
                // SAFETY: laid out so, see the module.
                unsafe {
                    let from = Line {
                        tile: moving.lines.from(l.line(moving.planes, block, part, x)),
                        places: &f.places,
                    };
                    let to = line(moving.tile, at, &term.y_places);
                    // Passes do not read in an order that would bring the next line by itself.
                    transform(simd, &f.y, [a, b], from, to, [l.line, 0]);
                }
            }
        }
    }
}

/// The x lines of one kz block, for all terms, to one sum without a half turn.
///
/// # Safety
/// No one else may use the spectra. The sum may lie where those of the first term do.
#[simd]
pub(super) unsafe fn multiply_columns<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.size;
    let (there, back) = (&f.x, &sum.image.x);
    let [tiles @ .., spare] = &mut own.tiles;
    let column = nx * 4 * l.lanes;
    let block_len = back.first_radix() * 2 * l.lanes;
    for y in 0..ny {
        let mut lines = [(spare.tile(), &[][..]); 2 * MAX_TERMS];
        let mut count = 0;
        let mut free = spare.tile();
        for (term, moving) in f.terms.iter().zip(spectra) {
            if moving.filled.is_empty() {
                continue;
            }
            let fixed = &term.spectrum.as_slice()[(block * ny + y) * column..][..column];
            // Half of it beside each part: else the products wait for it.
            let ahead = if f.is_large { fixed } else { &[] };
            let halves = ahead.split_at(ahead.len() / 2);
            for (part, ahead) in [halves.0, halves.1].into_iter().enumerate() {
                // SAFETY: laid out so, see the module.
                unsafe {
                    let from = line(moving.tile, l.column(moving.planes, part, y), moving.x_from);
                    let [done, other] =
                        first_passes(simd, there, [tiles[count].tile(), free], from, ahead);
                    free = other;
                    lines[count] = (done, &fixed[part * block_len..]);
                }
                count += 1;
            }
        }
        // SAFETY: laid out so, see the module.
        unsafe {
            let tiles = [tiles[2 * MAX_TERMS].tile(), free];
            let to = line(sum.tile, l.column(sum.planes, sum.part, y), &sum.image.x_to);
            let lines = &lines[..count];
            back.turn(
                simd,
                lines,
                2 * block_len,
                tiles,
                #[inline(always)]
                |x, v| to.put(simd, x, v),
            );
        }
    }
}

/// The y transforms back of one kz block of a sum.
///
/// # Safety
/// No one else may use its lines and its half spectra.
#[simd]
pub(super) unsafe fn inverse_block<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [a, b, ..] = &mut own.tiles;
    let (a, b) = (a.tile(), b.tile());
    // The half spectra of four sums, and where their lines go, have left the caches meanwhile.
    let next = if f.is_large && f.images.len() > 1 {
        [l.x_stride, l.line]
    } else {
        [0; 2]
    };
    for x in 0..f.window[0] {
        let at = l.column(sum.planes, sum.part, 0) + x * l.x_stride;
        // SAFETY: laid out so, see the module.
        unsafe {
            let from = line(sum.tile, at, &f.terms[0].y_places);
            let to = l.line(sum.planes, block, sum.part, x);
            let to = line(sum.lines, to, &sum.image.y_to);
            transform(simd, &sum.image.y, [a, b], from, to, next);
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
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
    out: &mut ArrayViewMut2<'_, T>,
) {
    let l = f.layout;
    let plane = own.plane.tile();
    let [a, b, lines, real, ..] = &mut own.tiles;
    let (a, b, lines, real) = (a.tile(), b.tile(), lines.tile(), real.tile());
    let [_, wy, wz] = f.window;
    let count = l.bundles(wy);
    for block in 0..l.blocks {
        for bundle in 0..count {
            let offset = 2 * bundle * l.row + block * l.lanes * 2 * l.lanes;
            // SAFETY: laid out so, see the module.
            unsafe {
                let line = sum.lines.from(l.line(sum.planes, block, sum.part, x));
                let from = line.from(bundle * l.lanes * 2 * l.lanes);
                transpose_block(simd, from, plane.from(offset));
            }
        }
    }
    let row = wz.next_multiple_of(l.lanes);
    for bundle in 0..count {
        // SAFETY: laid out so, see the module.
        unsafe {
            let from = plane.from(2 * bundle * l.row);
            z_inverse(simd, f, sum.image, from, lines, [a, b]);
            for z in (0..wz).step_by(l.lanes) {
                transpose(simd, lines.from(z * l.lanes), l.lanes, real.from(z), row);
            }
        }
        for lane in 0..l.lanes.min(wy - bundle * l.lanes) {
            // SAFETY: laid out so, see the module.
            let values = unsafe { real.slice(lane * row, wz) };
            let mut to = out.row_mut(bundle * l.lanes + lane);
            match to.as_slice_mut() {
                Some(to) => to.copy_from_slice(values),
                None => to.iter_mut().zip(values).for_each(|(to, v)| *to = *v),
            }
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
    image: &Image<T>,
    from: Tile<T>,
    to: Tile<T>,
    tiles: [Tile<T>; 2],
) {
    let (wanted, lanes) = (f.window[2], f.layout.lanes);
    let load = inlined(
        #[inline(always)]
        // SAFETY: laid out so, see the module.
        |k: usize| unsafe { from.get(simd, k) },
    );
    let store = inlined(
        #[inline(always)]
        |z: usize, [re, im]: [T::Native<S>; 2]| {
            for Output { index, factors } in image.z_to[z] {
                if index < wanted {
                    let [a, b] = factors;
                    let a = T::Native::<S>::splat(simd, a);
                    let b = T::Native::<S>::splat(simd, b);
                    // SAFETY: as demanded.
                    unsafe { to.store::<S>(index * lanes, re.mul_add(a, im * b)) };
                }
            }
        },
    );
    // SAFETY: as demanded.
    unsafe { f.z.process(simd, tiles, load, store) };
}
