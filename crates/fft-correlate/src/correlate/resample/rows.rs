//! Samples of a turned field for as many rows at once as a vector has lanes.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::DVec3;

use super::{PATCH, Turned};
use crate::lanes::Tile;
use crate::radix::inlined;
use crate::real::Real;

/// Samples the rows from `[x, y]` on to `bundle`: per z the real, then the imaginary parts. Returns
/// the range of z outside of which all are zero; `bundle` is written inside of it only.
#[simd]
pub(super) fn sample<S: Simd, T: Real>(
    simd: S,
    turned: &Turned<'_, T>,
    x: usize,
    y: usize,
    bundle: &mut [T],
) -> Range<usize> {
    let lanes = T::Native::<S>::LEN;
    let (sx, sy, sz) = (turned.step.x_axis, turned.step.y_axis, turned.step.z_axis);
    let corner = turned.start + sx * x as f64 + sy * y as f64;
    let middle = sy * (lanes as f64 - 1.0) / 2.0 + sz * (PATCH as f64 - 1.0) / 2.0;
    let within = turned.bounds[2].clone();
    let Range { start, end } = turned.hull.range(simd, x, y, lanes, within);
    let mut filled = start..start;
    let mut cells = [[Cells::<T::Eight<S>> {
        places: [0; 8],
        fractions: [T::Eight::<S>::splat(simd, T::zero()); 3],
    }; PATCH * MOST_PARTS]; 2];
    let [mut next, mut current] = cells.each_mut();
    let rows = rows(turned);
    let ask = size_of_val(turned.field.values.as_slice().unwrap_or_default()) > CACHED;
    let numbers = |z: Range<usize>| 2 * lanes * z.start..2 * lanes * z.end;
    // The patch whose cells are known, and whose values are on their way.
    let mut known = start..start;
    for z in (start..end).step_by(PATCH) {
        let patch = z..(z + PATCH).min(end);
        let at = corner + sz * z as f64;
        if !turned.field.occupied.near(at + middle) {
            bundle[numbers(patch)].fill(T::zero());
            continue;
        }
        find_patch(simd, turned, at, next);
        if ask {
            ask_for(rows, next);
        }
        if !known.is_empty() {
            sample_patch(simd, rows, current, &mut bundle[numbers(known)]);
        }
        std::mem::swap(&mut next, &mut current);
        filled.start = if filled.is_empty() { z } else { filled.start };
        filled.end = patch.end;
        known = patch;
    }
    if !known.is_empty() {
        sample_patch(simd, rows, current, &mut bundle[numbers(known)]);
    }
    filled
}

/// Parts of eight lanes of a patch at most.
const MOST_PARTS: usize = 2;

/// Eight samples before any value is read.
#[derive(Clone, Copy)]
struct Cells<V> {
    /// Where the first corner of each one's cell lies.
    places: [i32; 8],
    /// Places within the cells.
    fractions: [V; 3],
}

/// The field's numbers from the near and the far y of the near and the far x of cells on.
fn rows<T: Real>(turned: &Turned<'_, T>) -> [Tile<T>; 4] {
    let values = turned.field.values.as_slice();
    let values = values.expect("made in standard layout");
    let (_, ny, nz) = turned.field.values.dim();
    let numbers = Tile::<T>::shared(bytemuck::cast_slice(values));
    // SAFETY: a field has more than two rows in more than two planes.
    [0, nz, ny * nz, ny * nz + nz].map(|corner| unsafe { numbers.from(2 * corner) })
}

/// Where the samples of a patch lie, the first at index `at` of the field: in eights, of eight lanes at one
/// z or of fewer lanes at several.
#[inline(always)]
fn find_patch<S: Simd, T: Real>(
    simd: S,
    turned: &Turned<'_, T>,
    at: DVec3,
    cells: &mut [Cells<T::Eight<S>>],
) {
    let lanes = T::Native::<S>::LEN;
    let across = lanes.min(8);
    let parts = cells.chunks_mut(PATCH * across / 8).take(lanes / across);
    for (part, cells) in parts.enumerate() {
        find_cells(simd, turned, at, part * across, cells);
    }
}

/// Fields of fewer bytes stay in the second-level cache by themselves.
const CACHED: usize = 512 << 10;

/// Asks for the values of cells ahead of their use.
#[inline(always)]
fn ask_for<T: Real, V>(rows: [Tile<T>; 4], cells: &[Cells<V>]) {
    // Two corners of four: neighbours ask for the others.
    let [near, _, _, far] = rows;
    for eight in cells {
        for place in &eight.places {
            near.fetch(2 * *place as usize);
            far.fetch(2 * *place as usize);
        }
    }
}

/// Samples a patch.
#[inline(always)]
fn sample_patch<S: Simd, T: Real>(
    simd: S,
    rows: [Tile<T>; 4],
    cells: &[Cells<T::Eight<S>>],
    samples: &mut [T],
) {
    let lanes = T::Native::<S>::LEN;
    let (across, group) = (lanes.min(8), 2 * lanes.max(8));
    // Kept in memory: to take places out of vectors one by one takes longer.
    let cells: &[_] = std::hint::black_box(cells);
    for (part, cells) in cells
        .chunks(PATCH * across / 8)
        .take(lanes / across)
        .enumerate()
    {
        let first = part * across;
        for (elements, cells) in samples.chunks_mut(group).zip(cells) {
            // SAFETY: places are such that all corners of the cells lie within the field.
            let [re, im] = unsafe { interpolated(simd, rows, cells) };
            if lanes >= 8 {
                re.store_slice(&mut elements[first..first + 8]);
                im.store_slice(&mut elements[lanes + first..lanes + first + 8]);
                continue;
            }
            for (z, element) in elements.chunks_exact_mut(2 * lanes).enumerate() {
                let of = z * lanes..(z + 1) * lanes;
                element[..lanes].copy_from_slice(&re.as_slice()[of.clone()]);
                element[lanes..].copy_from_slice(&im.as_slice()[of]);
            }
        }
    }
}

/// Where the samples of a patch lie, in lanes from `first` on.
#[inline(always)]
fn find_cells<S: Simd, T: Real>(
    simd: S,
    turned: &Turned<'_, T>,
    at: DVec3,
    first: usize,
    cells: &mut [Cells<T::Eight<S>>],
) {
    let across = T::Native::<S>::LEN.min(8);
    let splat = inlined(
        #[inline(always)]
        |v: f64| T::Eight::<S>::splat(simd, T::nearest(v)),
    );
    let vector = inlined(
        #[inline(always)]
        |v: DVec3| [splat(v.x), splat(v.y), splat(v.z)],
    );
    let (nx, ny, nz) = turned.field.values.dim();
    // Relative to a node nearby, coordinates have no more than seven digits to round.
    let base = at.floor();
    let last = DVec3::new(nx as f64, ny as f64, nz as f64) - 1.5;
    let (low, high) = (vector(0.5 - base), vector(last - base));
    let (along_y, along_z) = (vector(turned.step.y_axis), vector(turned.step.z_axis));
    let corner = vector(at - base);
    // Samples are numbered along y, then along z.
    let (mut ys, mut zs) = ([T::zero(); 8], [T::zero(); 8]);
    for i in 0..8 {
        ys[i] = T::nearest((first + i % across) as f64);
        zs[i] = T::nearest((i / across) as f64);
    }
    let y = T::Eight::<S>::from_slice(simd, &ys);
    let mut z = T::Eight::<S>::from_slice(simd, &zs);
    let mut start = corner;
    for a in 0..3 {
        start[a] = along_y[a].mul_add(y, corner[a]);
    }
    let origin = (base.x as i64 * ny as i64 + base.y as i64) * nz as i64 + base.z as i64;
    let strides = [(ny * nz) as i32, nz as i32];
    // The last place whose cell lies within the field.
    let last = (nx * ny * nz - ny * nz - nz - 2) as i32;
    for cells in cells {
        let mut nodes = corner;
        for a in 0..3 {
            let at = along_z[a].mul_add(z, start[a]).max(low[a]).min(high[a]);
            nodes[a] = at.floor();
            cells.fractions[a] = at - nodes[a];
        }
        cells.places = T::places(simd, nodes, strides, origin as i32, last);
        z += splat((8 / across) as f64);
    }
}

/// Real and imaginary parts of eight samples. `rows` are the field's numbers from the near and the
/// far y of the near and the far x of cells on.
///
/// # Safety
/// All corners of the cells must lie within the field.
#[inline(always)]
unsafe fn interpolated<S: Simd, T: Real>(
    simd: S,
    rows: [Tile<T>; 4],
    cells: &Cells<T::Eight<S>>,
) -> [T::Eight<S>; 2] {
    let one = T::Eight::<S>::splat(simd, T::one());
    let [fx, fy, fz] = cells.fractions;
    let (gx, gy) = (one - fx, one - fy);
    let weights = [gx * gy, gx * fy, fx * gy, fx * fy];
    // Of samples p and p + 4 real and imaginary part at both z.
    let mut points = [one; 4];
    for (p, point) in points.iter_mut().enumerate() {
        let (a, b) = (cells.places[p] as u32, cells.places[p + 4] as u32);
        for (i, (row, weights)) in rows.iter().zip(&weights).enumerate() {
            // SAFETY: as demanded.
            let value = unsafe {
                row.quad(simd, 2 * a as usize)
                    .combine(row.quad(simd, 2 * b as usize))
            };
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

/// Rows of a square of numbers as columns.
#[inline(always)]
fn transposed<S: Simd, V: SimdFloat<S>>(rows: [V; 4]) -> [V; 4] {
    let (a, b) = rows[0].interleave(rows[2]);
    let (c, d) = rows[1].interleave(rows[3]);
    let (e, f) = a.interleave(c);
    let (g, h) = b.interleave(d);
    [e, f, g, h]
}
