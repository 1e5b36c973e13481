//! The three stages of one rotation: forward planes, products per block of columns (x transforms of
//! every term, products with the fixed spectra, one x transform back for each sum), inverse planes.

use std::ops::Range;
use web_time::Instant;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use ndarray::{ArrayViewMut2, ArrayViewMut3, Axis};
use sdf_grid::prefetch::ask_for;

use crate::correlate::contract::{MovingRows, StageTimes};
use crate::correlate::kernels::fused::{Fused, FusedScratch, PlaneScratch, Spectra, Sum, Term};
use crate::correlate::kernels::image::{Image, Output};
use crate::correlate::kernels::lane_fft::{first_passes, transform};
use crate::correlate::kernels::layout::{MAX_TERMS, PLANES};
use crate::correlate::kernels::radix::{add_mul, mul};
use crate::correlate::kernels::tile::{Buffer, Line, Tile, element, transpose};
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;
use crate::vectors::{dispatch_lanes, inlined};

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
    // Blocks from lanes of y to lanes of kz; lines outside the rows become zero.
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
    // A bundle without values transforms to zero.
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

/// Writes `f` at every window index, with the moving fields turned by each of `turns`, to the
/// `outs`, whose shape is the window's. Without turns there is one output, of the fields as they
/// are; what one turn gives does not depend on the others.
///
/// # Panics
/// If the number of fields or the shape of an output is not what was planned, the scratch is
/// another one's, or there are turns that were not planned for.
pub(crate) fn correlate<T: Real, M: MovingRows<T>>(
    f: &Fused<T>,
    moving: &[M],
    turns: &[HalfTurn],
    scratch: &mut FusedScratch<T>,
    outs: &mut [ArrayViewMut3<T>],
) -> StageTimes {
    assert_eq!(scratch.sizes, f.sizes, "scratch of another correlator");
    assert_eq!(moving.len(), f.terms.len());
    assert_eq!(outs.len(), turns.len().max(1));
    assert!(outs.iter().all(|out| out.shape() == f.sizes.window));
    let mut times = StageTimes::default();
    if moving.iter().all(|m| m.bounds()[0].is_empty()) {
        outs.iter_mut().for_each(|out| out.fill(T::zero()));
        return times;
    }
    let (spectra, more, own) = scratch.views(f, moving);
    let spectra = &spectra[..moving.len()];
    let sums: [Sum<T>; 4] = std::array::from_fn(|i| {
        let i = i.min(outs.len() - 1);
        sum(f, i, turns.get(i), &spectra[0], more)
    });
    let sums = &sums[..outs.len()];
    for (term, (field, to)) in moving.iter().zip(spectra).enumerate() {
        sample_and_transform(f, term, field, to, own, &mut times);
    }
    let shares = !turns.is_empty();
    for block in 0..f.layout.blocks {
        multiply_block(f, block, spectra, sums, shares, own, &mut times);
    }
    let began = Instant::now();
    for (sum, out) in sums.iter().zip(outs) {
        for (x, mut plane) in out.axis_iter_mut(Axis(0)).enumerate() {
            dispatch_lanes!(f.level, simd => inverse_plane(simd, f, x, sum, own, &mut plane));
        }
    }
    times.inverse += began.elapsed().as_secs_f64();
    times
}

/// Where the sum number `i` is made: the first two take the place of the first term.
fn sum<'a, T: Real>(
    f: &'a Fused<T>,
    i: usize,
    turn: Option<&HalfTurn>,
    first: &Spectra<'a, T>,
    more: Option<[Tile<'a, T>; 2]>,
) -> Sum<'a, T> {
    let [lines, block] = match (i, more) {
        (0 | 1, _) => [first.lines, first.block],
        (_, Some(more)) => more,
        _ => panic!("scratch without room for half turns"),
    };
    Sum {
        image: &f.images[turn.map_or(0, |turn| *turn as usize)],
        lines,
        block,
        part: i % 2,
        planes: first.planes,
    }
}

/// Stage 1 of one term.
fn sample_and_transform<T: Real, M: MovingRows<T>>(
    f: &Fused<T>,
    term: usize,
    field: &M,
    to: &Spectra<'_, T>,
    own: &mut PlaneScratch<T>,
    times: &mut StageTimes,
) {
    let rows = field.bounds()[1].clone();
    for first in to.filled.clone().step_by(PLANES) {
        let began = Instant::now();
        let sampled = first..(first + PLANES).min(to.filled.end);
        for (slot, x) in sampled.clone().enumerate() {
            dispatch_lanes!(f.level, simd => resample_plane(simd, f, field, x, slot, own));
        }
        let done = Instant::now();
        for (slot, x) in sampled.enumerate() {
            dispatch_lanes!(f.level, simd => {
                forward_plane(simd, f, &f.terms[term], [x, slot], rows.clone(), to, own)
            });
        }
        times.resample += (done - began).as_secs_f64();
        times.forward += done.elapsed().as_secs_f64();
    }
}

/// Stage 2 of one block of kz; `shares` says that the sums are of half turns.
fn multiply_block<T: Real>(
    f: &Fused<T>,
    block: usize,
    spectra: &[Spectra<'_, T>],
    sums: &[Sum<'_, T>],
    shares: bool,
    own: &mut PlaneScratch<T>,
    times: &mut StageTimes,
) {
    let began = Instant::now();
    dispatch_lanes!(f.level, simd => forward_block(simd, f, block, spectra, own));
    let forward = Instant::now();
    dispatch_lanes!(f.level, simd => if shares {
        multiply_images(simd, f, block, spectra, sums, own)
    } else {
        multiply_columns(simd, f, block, spectra, &sums[0], own)
    });
    let multiplied = Instant::now();
    for sum in sums {
        dispatch_lanes!(f.level, simd => inverse_block(simd, f, block, sum, own));
    }
    times.forward += (forward - began).as_secs_f64();
    times.product += (multiplied - forward).as_secs_f64();
    times.inverse += multiplied.elapsed().as_secs_f64();
}

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
