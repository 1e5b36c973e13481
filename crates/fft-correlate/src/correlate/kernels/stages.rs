//! Stages 1 and 3 and the y transforms of stage 2, one plane or one block of columns at a time.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::ArrayViewMut2;

use super::buffer::Buffer;
use super::fused::{Fused, Term};
use super::image::{Image, Output};
use super::lane_fft::transform;
use super::radix::mul;
use super::scratch::{PlaneScratch, Spectra, Sum};
use super::tile::{Line, Tile, transpose};
use crate::correlate::contract::MovingRows;
use crate::correlate::real::Real;
use crate::vectors::inlined;

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

/// Stage 1: one x plane of a moving field, sampled to a slot, y rows `rows`, to its lines along y
/// over kz.
#[simd]
pub(super) fn forward_plane<S: Simd, T: Real>(
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
    let work = own.work.each_mut().map(Buffer::tile);
    let first = slot * f.plane_bundles;
    let count = l.bundles(rows.len());
    for bundle in 0..count {
        let filled = own.filled[first + bundle].clone();
        for part in 0..2 {
            let from = bundles.from((first + bundle) * f.bundle);
            let to = plane.from((2 * bundle + part) * l.row);
            z_forward(
                simd,
                f,
                from,
                part,
                filled.clone(),
                term.half_deep,
                to,
                work,
            );
        }
    }
    let element = 2 * l.lanes;
    let zero = [T::Native::<S>::splat(simd, T::zero()); 2];
    for block in 0..l.blocks {
        for part in 0..2 {
            let line = to.lines.from(l.line(to.planes, block, part, x));
            for bundle in 0..count {
                let offset = (2 * bundle + part) * l.row + block * l.lanes * element;
                let to = line.from((rows.start + bundle * l.lanes) * element);
                transpose_block(simd, plane.from(offset), to);
            }
            // Rows beyond the last one may hold anything.
            for y in (0..rows.start).chain(rows.end..l.line_elements) {
                line.put(simd, y, zero);
            }
        }
    }
}

/// The half spectra of one part (0 real, 1 imaginary) of a bundle of lines that is zero outside
/// `filled`, written as a bundle. `real` says that nothing lies beyond half of the period.
#[inline(always)]
fn z_forward<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    from: Tile<'_, T>,
    part: usize,
    filled: Range<usize>,
    real: bool,
    to: Tile<'_, T>,
    tiles: [Tile<'_, T>; 2],
) {
    let half = f.layout.half;
    let lanes = f.layout.lanes;
    let zero = T::Native::<S>::splat(simd, T::zero());
    let store = inlined(
        #[inline(always)]
        |k: usize, v| to.put(simd, k, v),
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
                from.load(simd, (2 * z + part) * lanes)
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

/// One block of elements, lanes of which become elements and the other way round.
#[inline(always)]
fn transpose_block<S: Simd, T: Real>(simd: S, from: Tile<'_, T>, to: Tile<'_, T>) {
    let lanes = T::Native::<S>::LEN;
    transpose(simd, from, 2 * lanes, to, 2 * lanes);
    transpose(simd, from.from(lanes), 2 * lanes, to.from(lanes), 2 * lanes);
}

/// Stage 2: the y transforms of one kz block of all terms, to its half spectra.
#[simd]
pub(super) fn forward_block<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let work = own.work.each_mut().map(Buffer::tile);
    for (term, moving) in f.terms.iter().zip(spectra) {
        for part in 0..2 {
            for x in moving.filled.clone() {
                let at = l.column(moving.planes, part, 0) + x * l.x_stride;
                let from = l.line(moving.planes, block, part, x);
                let from = Line::new(moving.lines, from, &f.places);
                let to = Line::new(moving.block, at, &term.y_places);
                // Passes do not read in an order that would bring the next line by itself.
                transform(simd, &f.y, work, from, to, [l.line, 0]);
            }
        }
    }
}

/// The y transforms back of one kz block of a sum.
#[simd]
pub(super) fn inverse_block<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let work = own.work.each_mut().map(Buffer::tile);
    // The half spectra of four sums, and where their lines go, have left the caches meanwhile.
    let next = if f.is_large && f.images.len() > 1 {
        [l.x_stride, l.line]
    } else {
        [0; 2]
    };
    for x in 0..f.sizes.window[0] {
        let at = l.column(sum.planes, sum.part, 0) + x * l.x_stride;
        let from = Line::new(sum.block, at, &f.terms[0].y_places);
        let to = l.line(sum.planes, block, sum.part, x);
        let to = Line::new(sum.lines, to, &sum.image.y_to);
        transform(simd, &sum.image.y, work, from, to, next);
    }
}

/// Stage 3: one x plane of the sum to real values.
#[simd]
pub(super) fn inverse_plane<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    x: usize,
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
    out: &mut ArrayViewMut2<'_, T>,
) {
    let l = f.layout;
    let plane = own.plane.tile();
    let work = own.work.each_mut().map(Buffer::tile);
    let [lines, real, ..] = &mut own.parts;
    let lines = lines.tile();
    let [_, wy, wz] = f.sizes.window;
    let count = l.bundles(wy);
    for block in 0..l.blocks {
        for bundle in 0..count {
            let offset = 2 * bundle * l.row + block * l.lanes * 2 * l.lanes;
            let line = sum.lines.from(l.line(sum.planes, block, sum.part, x));
            let from = line.from(bundle * l.lanes * 2 * l.lanes);
            transpose_block(simd, from, plane.from(offset));
        }
    }
    let row = wz.next_multiple_of(l.lanes);
    for bundle in 0..count {
        let from = plane.from(2 * bundle * l.row);
        z_inverse(simd, f, sum.image, from, lines, work);
        for z in (0..wz).step_by(l.lanes) {
            transpose(
                simd,
                lines.from(z * l.lanes),
                l.lanes,
                real.tile().from(z),
                row,
            );
        }
        for lane in 0..l.lanes.min(wy - bundle * l.lanes) {
            let values = &real.as_slice()[lane * row..][..wz];
            let mut to = out.row_mut(bundle * l.lanes + lane);
            match to.as_slice_mut() {
                Some(to) => to.copy_from_slice(values),
                None => to.iter_mut().zip(values).for_each(|(to, v)| *to = *v),
            }
        }
    }
}

/// The real lines of a bundle of half spectra: one vector per wanted z.
#[inline(always)]
fn z_inverse<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    image: &Image<T>,
    from: Tile<'_, T>,
    to: Tile<'_, T>,
    tiles: [Tile<'_, T>; 2],
) {
    let (wanted, lanes) = (f.sizes.window[2], f.layout.lanes);
    let load = inlined(
        #[inline(always)]
        |k: usize| from.get(simd, k),
    );
    let store = inlined(
        #[inline(always)]
        |z: usize, [re, im]: [T::Native<S>; 2]| {
            for Output { index, factors } in image.z_to[z] {
                if index < wanted {
                    let [a, b] = factors;
                    let a = T::Native::<S>::splat(simd, a);
                    let b = T::Native::<S>::splat(simd, b);
                    to.store::<S>(index * lanes, re.mul_add(a, im * b));
                }
            }
        },
    );
    f.z.process(simd, tiles, load, store);
}
