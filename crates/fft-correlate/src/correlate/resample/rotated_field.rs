//! A field turned by one rotation, sampled on as many rows at once as a vector has lanes.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::{DMat3, DQuat, DVec3};
use ndarray::Array3;
use num_complex::Complex;

use crate::correlate::contract::MovingRows;
use crate::correlate::kernels::interpolation::{Cells, QuadraticReader, TrilinearReader};
use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;
use crate::correlate::resample::hull::RotatedHull;
use crate::correlate::resample::moving_field::{BORDER, MovingField, PATCH};
use crate::pair::interpolation::Interpolation;
use crate::vectors::inlined;

/// A field turned by one rotation; see [`RotatedField::new`].
pub(crate) struct RotatedField<'a, T> {
    pub(super) field: &'a MovingField<T>,
    /// The field's own, or others at its nodes.
    pub(super) values: &'a Array3<Complex<T>>,
    /// Columns: moving-lattice steps per fixed-lattice step.
    pub(super) step: DMat3,
    /// Moving-lattice index of fixed-lattice index `[0, 0, 0]` of the box.
    pub(super) start: DVec3,
    pub(super) hull: RotatedHull,
    pub(super) bounds: [Range<usize>; 3],
}

impl<'a, T: Real> RotatedField<'a, T> {
    /// `values` at the nodes of `field`, empty where it is, turned by `rotation`, at the fixed-lattice
    /// indices of `within`, counted from the corner of `placed`, a box around it; index 0 lies
    /// `origin` cells from the pivot.
    pub(crate) fn new(
        field: &'a MovingField<T>,
        values: &'a Array3<Complex<T>>,
        rotation: DQuat,
        origin: DVec3,
        placed: IndexBox,
        within: IndexBox,
    ) -> Self {
        let matrix = DMat3::from_quat(rotation);
        let back = matrix.transpose();
        let corner = origin + DVec3::from_array(placed.lo.map(|v| v as f64));
        let start = back * corner - field.first;
        Self {
            field,
            values,
            step: back,
            start,
            hull: field.hull.turned(start, &back),
            bounds: bounds(field, &matrix, corner, &placed, &within),
        }
    }

    /// Gradient of the real and of the imaginary part at a node, per cell along the moving
    /// lattice's axes; `None` beyond the field.
    pub(crate) fn gradient(&self, node: [usize; 3]) -> Option<[DVec3; 2]> {
        let at = self.start + self.step * DVec3::from_array(node.map(|n| n as f64));
        let mut sum = [DVec3::ZERO; 2];
        for (node, weights, slopes) in self.field.taps(at)? {
            let v = self.values[node];
            let [w, s] = [weights, slopes];
            let g = DVec3::new(s.x * w.y * w.z, w.x * s.y * w.z, w.x * w.y * s.z);
            let (re, im): (f64, f64) = (v.re.into(), v.im.into());
            sum[0] += re * g;
            sum[1] += im * g;
        }
        Some(sum)
    }
}

/// The bounding box of the turned values inside of `within`, as indices from the corner of
/// `placed` on, which lies `corner` cells from the pivot.
fn bounds<T: Real>(
    field: &MovingField<T>,
    matrix: &DMat3,
    corner: DVec3,
    placed: &IndexBox,
    within: &IndexBox,
) -> [Range<usize>; 3] {
    let (nx, ny, nz) = field.values.dim();
    let half = DVec3::new(nx as f64 - 1.0, ny as f64 - 1.0, nz as f64 - 1.0) / 2.0;
    // What reads no node but those of the border.
    let outer = BORDER as f64 - field.interpolation.reach();
    let middle = *matrix * (field.first + half) - corner;
    let reach = DVec3::from_array(std::array::from_fn(|a| {
        matrix.row(a).abs().dot(half - outer)
    }));
    let (lo, hi) = ((middle - reach).to_array(), (middle + reach).to_array());
    std::array::from_fn(|a| {
        let [from, to] = [within.lo[a], within.hi[a]].map(|i| (i - placed.lo[a]) as f64);
        let first = lo[a].ceil().clamp(from, to) as usize;
        let end = (hi[a].floor() + 1.0).clamp(first as f64, to) as usize;
        first..end
    })
}

impl<T: Real> MovingRows<T> for RotatedField<'_, T> {
    fn bounds(&self) -> [Range<usize>; 3] {
        self.bounds.clone()
    }

    fn fill_lanes<S: Simd>(&self, simd: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize> {
        match self.field.interpolation {
            Interpolation::Trilinear => sample::<S, T, false>(simd, self, x, y, bundle),
            Interpolation::Quadratic => sample::<S, T, true>(simd, self, x, y, bundle),
        }
    }
}

/// Samples the rows from `[x, y]` on to `bundle`: per z the real, then the imaginary parts. Returns
/// the range of z outside of which all are zero; `bundle` is written inside of it only.
#[simd]
fn sample<S: Simd, T: Real, const QUADRATIC: bool>(
    simd: S,
    turned: &RotatedField<'_, T>,
    x: usize,
    y: usize,
    bundle: &mut [T],
) -> Range<usize> {
    let lanes = T::Native::<S>::LEN;
    // The first sample, and the range of z that can meet the hull.
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
    let values = Values::new(turned.values);
    let ask = size_of_val(turned.values.as_slice().unwrap_or_default()) > CACHED;
    let numbers = |z: Range<usize>| 2 * lanes * z.start..2 * lanes * z.end;
    // The patch whose cells are known, and whose values are on their way.
    let mut known = start..start;
    // Patch by patch: find cells, fetch their values, sample the patch before.
    for z in (start..end).step_by(PATCH) {
        let patch = z..(z + PATCH).min(end);
        let at = corner + sz * z as f64;
        if !turned.field.occupied.is_occupied_near(at + middle) {
            bundle[numbers(patch)].fill(T::zero());
            continue;
        }
        find_patch::<S, T, QUADRATIC>(simd, turned, at, next);
        if ask {
            values.ask_for::<_, QUADRATIC>(next);
        }
        if !known.is_empty() {
            sample_patch::<S, T, QUADRATIC>(simd, values, current, &mut bundle[numbers(known)]);
        }
        std::mem::swap(&mut next, &mut current);
        filled.start = if filled.is_empty() { z } else { filled.start };
        filled.end = patch.end;
        known = patch;
    }
    if !known.is_empty() {
        sample_patch::<S, T, QUADRATIC>(simd, values, current, &mut bundle[numbers(known)]);
    }
    filled
}

/// A field's numbers, as they are read in either way.
#[derive(Clone, Copy)]
struct Values<'a, T> {
    corners: TrilinearReader<'a, T>,
    nodes: QuadraticReader<'a, T>,
}

impl<'a, T: Real> Values<'a, T> {
    fn new(values: &'a Array3<Complex<T>>) -> Self {
        Self {
            corners: TrilinearReader::new(values),
            nodes: QuadraticReader::new(values),
        }
    }

    /// Asks for the values of cells ahead of their use.
    #[inline(always)]
    fn ask_for<V, const QUADRATIC: bool>(self, cells: &[Cells<V>]) {
        match QUADRATIC {
            true => self.nodes.ask_for(cells),
            false => self.corners.ask_for(cells),
        }
    }
}

/// Parts of eight lanes of a patch at most.
const MOST_PARTS: usize = 2;

/// Where the samples of a patch lie, the first at index `at` of the field: in eights, of eight
/// lanes at one z or of fewer lanes at several.
#[inline(always)]
fn find_patch<S: Simd, T: Real, const QUADRATIC: bool>(
    simd: S,
    turned: &RotatedField<'_, T>,
    at: DVec3,
    cells: &mut [Cells<T::Eight<S>>],
) {
    let lanes = T::Native::<S>::LEN;
    let across = lanes.min(8);
    let parts = cells.chunks_mut(PATCH * across / 8).take(lanes / across);
    for (part, cells) in parts.enumerate() {
        find_cells::<S, T, QUADRATIC>(simd, turned, at, part * across, cells);
    }
}

/// Fields of fewer bytes stay in the second-level cache by themselves.
const CACHED: usize = 512 << 10;

/// Samples a patch.
#[inline(always)]
fn sample_patch<S: Simd, T: Real, const QUADRATIC: bool>(
    simd: S,
    values: Values<'_, T>,
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
            let [re, im] = match QUADRATIC {
                true => values.nodes.interpolated(simd, cells),
                false => values.corners.interpolated(simd, cells),
            };
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

/// Values from the first to the last that a sample reads, of a field of rows of `nz` in planes of
/// `ny`.
fn span<const QUADRATIC: bool>(ny: usize, nz: usize) -> usize {
    match QUADRATIC {
        true => 2 * (ny * nz + nz) + 4,
        false => ny * nz + nz + 2,
    }
}

/// Where the samples of a patch lie, in lanes from `first` on.
#[inline(always)]
fn find_cells<S: Simd, T: Real, const QUADRATIC: bool>(
    simd: S,
    turned: &RotatedField<'_, T>,
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
    let (nx, ny, nz) = turned.values.dim();
    // Relative to a node nearby, coordinates have no more than seven digits to round.
    let base = at.floor();
    let last = DVec3::new(nx as f64, ny as f64, nz as f64) - 1.5;
    // To the nearest node, the middle one of three.
    let (ahead, before) = if QUADRATIC { (0.5, 1) } else { (0.0, 0) };
    let (low, high) = (vector(0.5 - base), vector(last - base));
    let ahead = splat(ahead);
    // At the clamped place the node beyond the last counts for nothing.
    let furthest = vector(last - 0.5 - base);
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
    let [bx, by, bz] = [base.x, base.y, base.z].map(|b| b as i64 - before);
    let origin = (bx * ny as i64 + by) * nz as i64 + bz;
    let strides = [(ny * nz) as i32, nz as i32];
    // The last place whose nodes lie within the field.
    let last = (nx * ny * nz).saturating_sub(span::<QUADRATIC>(ny, nz)) as i32;
    for cells in cells {
        let mut nodes = corner;
        for a in 0..3 {
            let at = along_z[a].mul_add(z, start[a]).max(low[a]).min(high[a]);
            nodes[a] = (at + ahead).floor().min(furthest[a]);
            cells.fractions[a] = at - nodes[a];
        }
        cells.places = T::places(simd, nodes, strides, origin as i32, last);
        z += splat((8 / across) as f64);
    }
}
