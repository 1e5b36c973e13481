//! Trilinear lookups.

#![expect(
    clippy::needless_range_loop,
    reason = "lanes and axes index several arrays at once"
)]

use fearless_simd::{f32x4, f32x8, prelude::*};
use fearless_simd_macros::simd;

use super::grid::LookupGrid;
use super::map::Map;
use super::points::{Block, LANES, PointSet};

/// Per-lane quantities of one block, four copies each so that they line up with the four numbers
/// (re, im at z; re, im at z + 1) that one load brings. Aligned, as is then the stack, so that no
/// vector crosses a cache line.
#[repr(C, align(64))]
struct Lanes {
    offset: [u32; LANES],
    fraction: [[[f32; 4]; LANES]; 2],
    lever: [[[f32; 4]; LANES]; 3],
    /// Weights of the real part's value, of its z derivative, and of the imaginary part's value.
    weight: [[[f32; 4]; LANES]; 3],
}

#[simd]
pub(super) fn sum_clusters<S: Simd, const IMAGINARY: bool>(
    simd: S,
    points: &PointSet,
    grid: &LookupGrid,
    map: &Map,
    totals: &mut [f64; 8],
) {
    let mut lanes = Lanes {
        offset: [0; LANES],
        fraction: [[[0.0; 4]; LANES]; 2],
        lever: [[[0.0; 4]; LANES]; 3],
        weight: [[[0.0; 4]; LANES]; 3],
    };
    for cluster in &points.clusters {
        if map.misses(cluster, grid) {
            continue;
        }
        let mut sums = [f32x8::splat(simd, 0.0); 8];
        for block in &points.blocks[cluster.first as usize..cluster.last as usize] {
            prepare::<IMAGINARY>(block, grid.shape, map, &mut lanes);
            accumulate::<S, IMAGINARY>(simd, &lanes, grid, &mut sums);
        }
        for (total, sum) in totals.iter_mut().zip(sums) {
            let lanes: [f32; 8] = sum.into();
            *total += f64::from(lanes.iter().sum::<f32>());
        }
    }
}

/// Places a block's points in the grid.
#[inline(always)]
fn prepare<const IMAGINARY: bool>(block: &Block, shape: [usize; 3], map: &Map, lanes: &mut Lanes) {
    let [x, y, z] = &block.position;
    let mut lever = [[0.0f32; LANES]; 3];
    let mut cell = [[0u32; LANES]; 3];
    let mut fraction = [[0.0f32; LANES]; 3];
    for a in 0..3 {
        let row = map.rows[a];
        // Clamped into the middle of the outermost cells, where everything is zero.
        let last = shape[a] as f32 - 1.5;
        for v in 0..LANES {
            let r = row[0] * x[v] + row[1] * y[v] + row[2] * z[v];
            let u = (r + map.centre[a]).max(0.5).min(last);
            lever[a][v] = r;
            cell[a][v] = u as i32 as u32;
            fraction[a][v] = u - cell[a][v] as i32 as f32;
        }
    }
    let (row, plane) = (shape[2] as u32, (shape[1] * shape[2]) as u32);
    for v in 0..LANES {
        lanes.offset[v] = 2 * (cell[0][v] * plane + cell[1][v] * row + cell[2][v]);
    }
    for v in 0..LANES {
        let (re, im, z) = (block.weight[0][v], block.weight[1][v], fraction[2][v]);
        lanes.weight[0][v] = [re * (1.0 - z), -im * (1.0 - z), re * z, -im * z];
        lanes.weight[1][v] = [-re, im, re, -im];
        if IMAGINARY {
            lanes.weight[2][v] = [im * (1.0 - z), re * (1.0 - z), im * z, re * z];
        }
    }
    for v in 0..LANES {
        for a in 0..2 {
            lanes.fraction[a][v] = [fraction[a][v]; 4];
        }
        for a in 0..3 {
            lanes.lever[a][v] = [lever[a][v]; 4];
        }
    }
}

/// The two points `2 * pair` and `2 * pair + 1` of a per-lane quantity.
#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &[[f32; 4]; LANES], pair: usize) -> f32x8<S> {
    f32x8::from_slice(simd, lanes[2 * pair..2 * pair + 2].as_flattened())
}

/// Real and imaginary part at two z-neighbours, for two points.
#[inline(always)]
fn corner<S: Simd>(simd: S, values: &[f32], at: [usize; 2], offset: usize) -> f32x8<S> {
    let (a, b) = (at[0] + offset, at[1] + offset);
    let low = f32x4::from_slice(simd, &values[a..a + 4]);
    low.combine(f32x4::from_slice(simd, &values[b..b + 4]))
}

/// Adds a block's weighted values, gradients and moments, two points at a time.
#[inline(always)]
fn accumulate<S: Simd, const IMAGINARY: bool>(
    simd: S,
    lanes: &Lanes,
    grid: &LookupGrid,
    sums: &mut [f32x8<S>; 8],
) {
    let row = 2 * grid.shape[2];
    let plane = row * grid.shape[1];
    let values = grid.values.as_slice();
    for pair in 0..LANES / 2 {
        let at = [
            lanes.offset[2 * pair] as usize,
            lanes.offset[2 * pair + 1] as usize,
        ];
        let c00 = corner(simd, values, at, 0);
        let c01 = corner(simd, values, at, row);
        let c10 = corner(simd, values, at, plane);
        let c11 = corner(simd, values, at, plane + row);
        let fx = load(simd, &lanes.fraction[0], pair);
        let fy = load(simd, &lanes.fraction[1], pair);
        let (dy0, dy1) = (c01 - c00, c11 - c10);
        let (low, high) = (fy.mul_add(dy0, c00), fy.mul_add(dy1, c10));
        let dx = high - low;
        let dy = fx.mul_add(dy1 - dy0, dy0);
        let value = fx.mul_add(dx, low);

        let weight = load(simd, &lanes.weight[0], pair);
        let (gx, gy) = (dx * weight, dy * weight);
        let gz = value * load(simd, &lanes.weight[1], pair);
        let rx = load(simd, &lanes.lever[0], pair);
        let ry = load(simd, &lanes.lever[1], pair);
        let rz = load(simd, &lanes.lever[2], pair);
        sums[0] = value.mul_add(weight, sums[0]);
        if IMAGINARY {
            sums[1] = value.mul_add(load(simd, &lanes.weight[2], pair), sums[1]);
        }
        sums[2] += gx;
        sums[3] += gy;
        sums[4] += gz;
        sums[5] = ry.mul_add(gz, sums[5] - rz * gy);
        sums[6] = rz.mul_add(gx, sums[6] - rx * gz);
        sums[7] = rx.mul_add(gy, sums[7] - ry * gx);
    }
}
