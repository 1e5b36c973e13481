//! What a rotation costs before it runs: a model of the stages' times, and the transform sizes that
//! it finds cheapest.
//!
//! Each stage is a number of vectors of lanes that pass through transforms, products and samples;
//! the model weighs them with times measured on one thread of a Zen 3 server with vectors of eight
//! f32 (AVX2); at 128 points per axis it is within a few percent, at 64, where everything stays in
//! the caches, 15 % too long. Other machines differ by a factor that hardly changes which size
//! is best.

use super::kernels::steps::{Ends, Step, cost, known, steps, turning_steps};

/// Nanoseconds of a radix-2 pass over one complex element of eight lanes.
const PASS: f64 = 1.1;

/// Nanoseconds to read, write and transpose one complex element of eight lanes, of one product with
/// a spectrum that comes from memory, and of one resampled value where half of the box is empty.
const MOVE: f64 = 1.6;
const PRODUCT: f64 = 0.5;
const SAMPLE: f64 = 2.3;

/// Lanes that the times are for.
const LANES: usize = 8;

/// What one product needs: nodes of the moving box.
pub(crate) type Moving = [usize; 3];

/// Seconds of one rotation on one thread, for transforms of this size, if the moving transforms are
/// shared by as many as `sharing`; `None` if the kernels have not all factors of it.
pub(crate) fn seconds(
    size: [usize; 3],
    window: [usize; 3],
    moving: &[Moving],
    sharing: usize,
) -> Option<f64> {
    let [nx, ny, nz] = size;
    if !nz.is_multiple_of(2) {
        return None;
    }
    let half = nz / 2;
    let blocks = half.div_ceil(LANES);
    let halves = |axis: usize| {
        let half = size[axis] / 2;
        (moving.iter().all(|m| m[axis] <= half), window[axis] <= half)
    };
    let (from_half, to_half) = halves(0);
    let [x, x_back] = turning_steps(nx, from_half, to_half)?.map(|s| line(nx, &s));
    let (from_half, to_half) = halves(1);
    let y = |from_half, to_half| {
        let ends = Ends {
            from_half,
            to_half,
            ..Ends::default()
        };
        Some(line(ny, &steps(ny, ends)?))
    };
    let (y, y_back) = (y(from_half, false)?, y(false, to_half)?);
    let z = line(half, &steps(half, Ends::default())?);
    let bundles = |rows: usize| rows.div_ceil(LANES) as f64;
    let columns = (blocks * ny) as f64;
    let (mut shared, mut total) = (0.0, 0.0);
    for [mx, my, mz] in moving {
        let planes = *mx as f64;
        shared += SAMPLE * planes * (my * mz) as f64;
        // Two real parts each: z lines of the bundles, y lines of the blocks, x lines.
        shared += 2.0 * planes * (bundles(*my) * z + blocks as f64 * y);
        shared += columns * 2.0 * x;
        total += columns * nx as f64 * PRODUCT;
    }
    total += shared / sharing as f64;
    let planes = window[0] as f64;
    total += columns * x_back + planes * (blocks as f64 * y_back + bundles(window[1]) * z);
    Some(1e-9 * total)
}

/// Nanoseconds of one transform of lines of `len` points.
fn line(len: usize, steps: &[Step]) -> f64 {
    len as f64 * (PASS * cost(steps) + MOVE)
}

/// The cheapest transform size of at least `min` points along each axis.
pub(crate) fn best_size(min: [usize; 3], window: [usize; 3], moving: &[Moving]) -> [usize; 3] {
    // Per axis the shortest lengths; a power of two lies below twice the least.
    let lengths = |axis: usize| -> Vec<usize> {
        let (min, step) = (min[axis].max(1), if axis == 2 { 2 } else { 1 });
        let fits = |n: &usize| n.is_multiple_of(step) && known(n / step);
        (min..=2 * min).filter(fits).take(6).collect()
    };
    let mut best = (f64::INFINITY, min);
    let (xs, ys, zs) = (lengths(0), lengths(1), lengths(2));
    for x in &xs {
        for y in &ys {
            for z in &zs {
                let size = [*x, *y, *z];
                let cost = seconds(size, window, moving, 1).unwrap_or(f64::MAX);
                if cost < best.0 {
                    best = (cost, size);
                }
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_known_large_enough_and_no_worse_than_their_neighbours() {
        for min in (1..300).step_by(7) {
            let min = [min, 2 * min / 3 + 1, min / 2 + 1];
            let window = min.map(|n| n / 2 + 1);
            let moving = [window];
            let size = best_size(min, window, &moving);
            let cost = seconds(size, window, &moving, 1).expect("a size of known factors");
            for axis in 0..3 {
                assert!(size[axis] >= min[axis], "{min:?} -> {size:?}");
                let mut longer = size;
                longer[axis] = 2 * size[axis];
                assert!(seconds(longer, window, &moving, 1).is_none_or(|c| c > cost));
            }
        }
        let half = [64; 3];
        assert_eq!(best_size([127; 3], half, &[half]), [128; 3]);
    }

    #[test]
    fn more_work_costs_more() {
        let cost = |moving: usize, window: usize, terms: usize| {
            seconds([128; 3], [window; 3], &vec![[moving; 3]; terms], 1).unwrap()
        };
        assert!(cost(64, 64, 1) < cost(96, 64, 1));
        assert!(cost(64, 64, 1) < cost(64, 96, 1));
        assert!(cost(64, 64, 1) < cost(64, 64, 2));
        assert!(
            seconds([7, 8, 8], [1; 3], &[], 1).is_none()
                && seconds([8; 3], [1; 3], &[], 1).is_some()
        );
    }
}
