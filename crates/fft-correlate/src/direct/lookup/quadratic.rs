//! Lookups by quadratic B-splines.

use fearless_simd::{f32x4, f32x8, i32x8, prelude::*};
use fearless_simd_macros::simd;

use super::grid::LookupGrid;
use super::map::Map;
use super::points::{Block, LANES, PointSet};
use crate::vectors::{inlined, transposed};

/// Points that are placed together.
const EIGHT: usize = 8;

/// What eight points need. Along z, weights stand eight in a row like the numbers that one load
/// brings: real and imaginary part at three nodes, and a fourth that counts for nothing. Aligned, as
/// is then the stack, so that no vector crosses a cache line.
#[repr(C, align(64))]
struct Lanes {
    offset: [i32; EIGHT],
    /// Weights of the three nodes along x and y, and their derivatives.
    weight: [[[f32; EIGHT]; 3]; 2],
    slope: [[[f32; EIGHT]; 3]; 2],
    lever: [[f32; EIGHT]; 3],
    /// Weights of the real part's value, of its z derivative, and of the imaginary part's value.
    along: [[[f32; 8]; EIGHT]; 3],
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
        offset: [0; EIGHT],
        weight: [[[0.0; EIGHT]; 3]; 2],
        slope: [[[0.0; EIGHT]; 3]; 2],
        lever: [[0.0; EIGHT]; 3],
        along: [[[0.0; 8]; EIGHT]; 3],
    };
    for cluster in &points.clusters {
        if map.misses(cluster, grid) {
            continue;
        }
        let mut sums = [f32x8::splat(simd, 0.0); 8];
        for block in &points.blocks[cluster.first as usize..cluster.last as usize] {
            for first in (0..LANES).step_by(EIGHT) {
                prepare::<S, IMAGINARY>(simd, block, first, grid.shape, map, &mut lanes);
                accumulate::<S, IMAGINARY>(simd, &lanes, grid, &mut sums);
            }
        }
        for (total, sum) in totals.iter_mut().zip(sums) {
            let lanes: [f32; 8] = sum.into();
            *total += f64::from(lanes.iter().sum::<f32>());
        }
    }
}

/// Places eight of a block's points in the grid.
#[inline(always)]
fn prepare<S: Simd, const IMAGINARY: bool>(
    simd: S,
    block: &Block,
    first: usize,
    shape: [usize; 3],
    map: &Map,
    lanes: &mut Lanes,
) {
    let splat = inlined(
        #[inline(always)]
        |v: f32| f32x8::splat(simd, v),
    );
    let of = first..first + EIGHT;
    let x = f32x8::from_slice(simd, &block.position[0][of.clone()]);
    let y = f32x8::from_slice(simd, &block.position[1][of.clone()]);
    let z = f32x8::from_slice(simd, &block.position[2][of.clone()]);
    let half = splat(0.5);
    let mut offset = i32x8::splat(simd, 0);
    let strides = [shape[1] * shape[2], shape[2], 1];
    let (mut weights, mut slopes) = ([half; 3], [half; 3]);
    for a in 0..3 {
        let [rx, ry, rz] = map.rows[a];
        let r = splat(rx).mul_add(x, splat(ry).mul_add(y, splat(rz) * z));
        // Clamped to where the nodes read are still zeros.
        let u = (r + splat(map.centre[a]))
            .max(half)
            .min(splat(shape[a] as f32 - 1.5));
        let nearest = (u + half).floor().min(splat(shape[a] as f32 - 2.0));
        let t = u - nearest;
        let (below, above) = (half - t, half + t);
        weights = [
            half * below * below,
            splat(0.75) - t * t,
            half * above * above,
        ];
        slopes = [splat(0.0) - below, splat(-2.0) * t, above];
        let node = (nearest - splat(1.0)).to_int::<i32x8<S>>();
        offset += node * i32x8::splat(simd, 2 * strides[a] as i32);
        r.store_slice(&mut lanes.lever[a]);
        if a < 2 {
            for n in 0..3 {
                weights[n].store_slice(&mut lanes.weight[a][n]);
                slopes[n].store_slice(&mut lanes.slope[a][n]);
            }
        }
    }
    lanes.offset = offset.into();
    let re = f32x8::from_slice(simd, &block.weight[0][of.clone()]);
    let im = f32x8::from_slice(simd, &block.weight[1][of]);
    let minus = splat(0.0) - im;
    along(simd, weights, [re, minus], &mut lanes.along[0]);
    along(simd, slopes, [re, minus], &mut lanes.along[1]);
    if IMAGINARY {
        along(simd, weights, [im, re], &mut lanes.along[2]);
    }
}

/// Products of the weights of three nodes with two numbers, point by point.
#[inline(always)]
fn along<S: Simd>(
    simd: S,
    nodes: [f32x8<S>; 3],
    numbers: [f32x8<S>; 2],
    points: &mut [[f32; 8]; EIGHT],
) {
    let zero = f32x4::splat(simd, 0.0);
    let [re, im] = numbers;
    let (re_a, re_a_later) = (re * nodes[0]).split();
    let (im_a, im_a_later) = (im * nodes[0]).split();
    let (re_b, re_b_later) = (re * nodes[1]).split();
    let (im_b, im_b_later) = (im * nodes[1]).split();
    let (re_c, re_c_later) = (re * nodes[2]).split();
    let (im_c, im_c_later) = (im * nodes[2]).split();
    let near = transposed([re_a, im_a, re_b, im_b]);
    let near_later = transposed([re_a_later, im_a_later, re_b_later, im_b_later]);
    let far = transposed([re_c, im_c, zero, zero]);
    let far_later = transposed([re_c_later, im_c_later, zero, zero]);
    for p in 0..4 {
        near[p].combine(far[p]).store_slice(&mut points[p]);
        near_later[p]
            .combine(far_later[p])
            .store_slice(&mut points[p + 4]);
    }
}

/// Adds eight points' weighted values, gradients and moments.
#[inline(always)]
fn accumulate<S: Simd, const IMAGINARY: bool>(
    simd: S,
    lanes: &Lanes,
    grid: &LookupGrid,
    sums: &mut [f32x8<S>; 8],
) {
    let row = 2 * grid.shape[2];
    let plane = row * grid.shape[1];
    let zero = f32x8::splat(simd, 0.0);
    for v in 0..EIGHT {
        let values = &grid.values[lanes.offset[v] as u32 as usize..];
        let (mut value, mut dx, mut dy) = (zero, zero, zero);
        for j in 0..3 {
            let (mut across, mut along) = (zero, zero);
            for i in 0..3 {
                let at = i * plane + j * row;
                let numbers = f32x8::from_slice(simd, &values[at..at + 8]);
                across = numbers.mul_add(f32x8::splat(simd, lanes.weight[0][i][v]), across);
                along = numbers.mul_add(f32x8::splat(simd, lanes.slope[0][i][v]), along);
            }
            let w = f32x8::splat(simd, lanes.weight[1][j][v]);
            value = across.mul_add(w, value);
            dx = along.mul_add(w, dx);
            dy = across.mul_add(f32x8::splat(simd, lanes.slope[1][j][v]), dy);
        }
        let weight = f32x8::from_slice(simd, &lanes.along[0][v]);
        let (gx, gy) = (dx * weight, dy * weight);
        let gz = value * f32x8::from_slice(simd, &lanes.along[1][v]);
        let rx = f32x8::splat(simd, lanes.lever[0][v]);
        let ry = f32x8::splat(simd, lanes.lever[1][v]);
        let rz = f32x8::splat(simd, lanes.lever[2][v]);
        sums[0] = value.mul_add(weight, sums[0]);
        if IMAGINARY {
            let weight = f32x8::from_slice(simd, &lanes.along[2][v]);
            sums[1] = value.mul_add(weight, sums[1]);
        }
        sums[2] += gx;
        sums[3] += gy;
        sums[4] += gz;
        sums[5] = ry.mul_add(gz, sums[5] - rz * gy);
        sums[6] = rz.mul_add(gx, sums[6] - rx * gz);
        sums[7] = rx.mul_add(gy, sums[7] - ry * gx);
    }
}
