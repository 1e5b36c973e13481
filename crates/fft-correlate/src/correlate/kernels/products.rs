//! The products of stage 2: x transforms of every term, products with the fixed spectra, one x
//! transform back for each sum.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

use super::buffer::Buffer;
use super::fused::Fused;
use super::image::Image;
use super::lane_fft::{first_passes, transform};
use super::layout::MAX_TERMS;
use super::radix::{add_mul, mul};
use super::scratch::{PlaneScratch, Spectra, Sum};
use super::tile::{Line, Tile, element};
use crate::correlate::real::Real;
use sdf_grid::prefetch::ask_for;

/// The x lines of one kz block, for all terms, to one sum without a half turn.
#[simd]
pub(super) fn multiply_columns<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sum: &Sum<'_, T>,
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.sizes.transform;
    let (there, back) = (&f.x, &sum.image.x);
    let parts = own.parts.each_mut().map(Buffer::tile);
    let [first, spare] = own.work.each_mut().map(Buffer::tile);
    let column = nx * 4 * l.lanes;
    let block_len = back.first_radix() * 2 * l.lanes;
    for y in 0..ny {
        let mut lines = [(spare, &[][..]); 2 * MAX_TERMS];
        let mut count = 0;
        let mut free = spare;
        for (term, moving) in f.terms.iter().zip(spectra) {
            if moving.filled.is_empty() {
                continue;
            }
            let fixed = &term.spectrum.as_slice()[(block * ny + y) * column..][..column];
            // Half of it beside each part: else the products wait for it.
            let ahead = if f.is_large { fixed } else { &[] };
            let halves = ahead.split_at(ahead.len() / 2);
            for (part, ahead) in [halves.0, halves.1].into_iter().enumerate() {
                let from = Line::new(
                    moving.block,
                    l.column(moving.planes, part, y),
                    moving.x_from,
                );
                let [done, other] = first_passes(simd, there, [parts[count], free], from, ahead);
                free = other;
                lines[count] = (done, &fixed[part * block_len..]);
                count += 1;
            }
        }
        let to = Line::new(
            sum.block,
            l.column(sum.planes, sum.part, y),
            &sum.image.x_to,
        );
        let lines = &lines[..count];
        back.turn(
            simd,
            lines,
            2 * block_len,
            [first, free],
            #[inline(always)]
            |x, v| to.put(simd, x, v),
        );
    }
}

/// Columns in an order in which those of `ky` and `-ky` follow each other.
fn columns(ny: usize) -> impl Iterator<Item = usize> {
    (0..ny).map(move |i| {
        let pair = i.div_ceil(2);
        if i % 2 == 1 { pair } else { (ny - pair) % ny }
    })
}

/// The x lines of one kz block, for all terms and all sums: transforms there, products, and
/// transforms back to the sums' half spectra.
#[simd]
pub(super) fn multiply_images<S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sums: &[Sum<'_, T>],
    own: &mut PlaneScratch<T>,
) {
    let l = f.layout;
    let [nx, ny, _] = f.sizes.transform;
    let done = own.parts.each_mut().map(Buffer::tile);
    let work = own.work.each_mut().map(Buffer::tile);
    let column = nx * 4 * l.lanes;
    let fixed = |term: usize, y: usize| -> &[T] {
        &f.terms[term].spectrum.as_slice()[(block * ny + y) * column..][..column]
    };
    let mut next = columns(ny).skip(2);
    for y in columns(ny) {
        let (lines, count) = transformed(simd, f, spectra, y, work, done);
        // The columns after the next are asked for meanwhile: else the products wait for them.
        let after = next.next().filter(|_| f.is_large);
        for (i, sum) in sums.iter().enumerate() {
            let from = if sum.image.mirrored { (ny - y) % ny } else { y };
            let share = column.div_ceil(sums.len());
            let share = (i * share).min(column)..((i + 1) * share).min(column);
            let line_of = |i: usize| {
                let (tile, term, offset) = lines[i];
                let ahead = match after {
                    Some(y) if offset == 0 => &fixed(term, y)[share.clone()],
                    _ => &[],
                };
                Factors {
                    moving: tile,
                    fixed: &fixed(term, from)[offset..],
                    ahead,
                }
            };
            let to = Line::new(
                sum.block,
                l.column(sum.planes, sum.part, y),
                &sum.image.x_to,
            );
            match count {
                2 => sum_back(simd, sum.image, [line_of(0), line_of(1)], work, to),
                _ => sum_back(
                    simd,
                    sum.image,
                    [line_of(0), line_of(1), line_of(2), line_of(3)],
                    work,
                    to,
                ),
            }
        }
    }
}

/// The x transforms of one column of all terms: lines with their terms and where the fixed spectra
/// of their parts begin in a column; and how many there are.
#[inline(always)]
fn transformed<'a, S: Simd, T: Real>(
    simd: S,
    f: &Fused<T>,
    spectra: &[Spectra<'a, T>],
    y: usize,
    work: [Tile<'a, T>; 2],
    done: [Tile<'a, T>; 2 * MAX_TERMS],
) -> ([(Tile<'a, T>, usize, usize); 2 * MAX_TERMS], usize) {
    let l = f.layout;
    let part_offset = f.images[0].x.first_radix() * 2 * l.lanes;
    let mut lines = [(work[0], 0, 0); 2 * MAX_TERMS];
    let mut count = 0;
    for (term, moving) in spectra.iter().enumerate() {
        if moving.filled.is_empty() {
            continue;
        }
        for part in 0..2 {
            let from = l.column(moving.planes, part, y);
            let from = Line::new(moving.block, from, moving.x_from);
            let to = Line::new(done[count], 0, &f.places);
            transform(simd, &f.x, work, from, to, [0, 0]);
            lines[count] = (done[count], term, part * part_offset);
            count += 1;
        }
    }
    (lines, count)
}

/// A line of the moving field and its column of the fixed spectra.
struct Factors<'a, T> {
    moving: Tile<'a, T>,
    fixed: &'a [T],
    /// What is to be on its way to the second-level cache meanwhile.
    ahead: &'a [T],
}

/// The transform back along x of the sum of products of lines with fixed spectra.
#[simd]
fn sum_back<S: Simd, T: Real, const LINES: usize>(
    simd: S,
    image: &Image<T>,
    lines: [Factors<'_, T>; LINES],
    work: [Tile<'_, T>; 2],
    to: Line<'_, T>,
) {
    let sign = T::Native::<S>::splat(simd, image.sign);
    let share = lines[0].ahead.len().div_ceil(image.order.len());
    image.x.process(
        simd,
        work,
        #[inline(always)]
        |k| {
            // Where the result goes has not been touched for a while.
            to.fetch::<S>(k, 0);
            let at = image.order[k];
            let mut sum = [sign; 2];
            for (i, line) in lines.iter().enumerate() {
                if share > 0 {
                    ask_for(line.ahead, k * share, share.min(line.ahead.len()));
                }
                let [re, im] = element(simd, &line.fixed[at..]);
                let (a, b) = ([re, im * sign], line.moving.get(simd, k));
                sum = if i == 0 {
                    mul(a, b)
                } else {
                    add_mul(sum, a, b)
                };
            }
            sum
        },
        #[inline(always)]
        |x, v| to.put(simd, x, v),
    );
}
