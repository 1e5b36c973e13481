//! Where lines along the fixed lattice's z may meet a turned field: slabs around its occupied
//! nodes, normal to all small whole directions. The slabs around a ball hold a few percent more
//! than the ball, its bounding box twice as much.

use std::array::from_fn;
use std::ops::Range;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3};
use ndarray::{Array3, s};
use num_complex::Complex;

use crate::correlate::real::Real;
use crate::pair::interpolation::Interpolation;

/// Normals: all directions with coordinates up to 2, and repetitions that fill vectors of eight.
const COUNT: usize = 56;

/// Cells by which a slab is thicker than the field, far beyond rounding.
const SLACK: f64 = 0.01;

/// Slabs that hold every place that reads an occupied node.
pub(crate) struct Hull {
    normals: [DVec3; COUNT],
    /// Least and greatest component of a place within reach along each normal.
    bounds: [[f64; 2]; COUNT],
}

impl Hull {
    /// Around all nodes that are not zero, of which there must be some; places are indices of the
    /// lattice.
    pub(crate) fn new<T: Real>(values: &Array3<Complex<T>>, interpolation: Interpolation) -> Self {
        let normals = normals();
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; COUNT];
        let (nx, ny, _) = values.dim();
        let occupied = |v: &Complex<T>| *v != Complex::default();
        for (i, j) in (0..nx).flat_map(|i| (0..ny).map(move |j| (i, j))) {
            // Between its ends a row adds nothing to slabs.
            let row = values.slice(s![i, j, ..]);
            let first = row.iter().position(occupied);
            let ends = first.into_iter().chain(row.iter().rposition(occupied));
            for k in ends {
                let node = DVec3::new(i as f64, j as f64, k as f64);
                for (normal, [low, high]) in normals.iter().zip(&mut bounds) {
                    let at = normal.dot(node);
                    *low = low.min(at);
                    *high = high.max(at);
                }
            }
        }
        for (normal, [low, high]) in normals.iter().zip(&mut bounds) {
            // To the farthest place that reads a node.
            let reach = interpolation.reach() * normal.abs().element_sum() + SLACK;
            *low -= reach;
            *high += reach;
        }
        Self { normals, bounds }
    }

    /// For lines along z of a lattice whose node `[x, y, z]` lies at `start + step [x, y, z]`.
    pub(crate) fn turned(&self, start: DVec3, step: &DMat3) -> RotatedHull {
        // Per normal n and slab [low, high]: low <= n . (start + x sx + y sy + z sz) <= high.
        let mut hull = RotatedHull {
            first: [0.0; COUNT],
            by_x: [0.0; COUNT],
            by_y: [0.0; COUNT],
            length: [0.0; COUNT],
        };
        for (i, (normal, [low, high])) in self.normals.iter().zip(&self.bounds).enumerate() {
            let along = normal.dot(step.z_axis);
            // Lines along the slab lie in it for a finite length that is longer than any lattice.
            let rate = 1.0 / (along.abs().max(1e-7) * along.signum());
            let from = if rate > 0.0 { low } else { high };
            hull.first[i] = ((from - normal.dot(start)) * rate) as f32;
            hull.by_x[i] = (-normal.dot(step.x_axis) * rate) as f32;
            hull.by_y[i] = (-normal.dot(step.y_axis) * rate) as f32;
            hull.length[i] = ((high - low) * rate.abs()) as f32;
        }
        hull
    }
}

/// A [`Hull`] under one rotation: z at which line `[x, y]` enters each slab is
/// `first + x by_x + y by_y`; it leaves after `length`.
pub(crate) struct RotatedHull {
    first: [f32; COUNT],
    by_x: [f32; COUNT],
    by_y: [f32; COUNT],
    length: [f32; COUNT],
}

impl RotatedHull {
    /// A range of z within `within` outside of which lines `[x, y]` to `[x, y + lines - 1]` meet
    /// nothing.
    #[inline(always)]
    pub(crate) fn range<S: Simd>(
        &self,
        simd: S,
        x: usize,
        y: usize,
        lines: usize,
        within: Range<usize>,
    ) -> Range<usize> {
        let [low, high] = range_of(simd, self, [x, y, lines - 1].map(|v| v as f32));
        // Casts of negative and infinite numbers end at the ends.
        let first = (low.ceil() as usize).clamp(within.start, within.end);
        let end = (high + 1.0).floor() as usize;
        first..end.clamp(first, within.end)
    }
}

#[simd]
fn range_of<S: Simd>(simd: S, hull: &RotatedHull, [x, y, across]: [f32; 3]) -> [f32; 2] {
    let splat = |v: f32| f32x8::splat(simd, v);
    let (x, y, across, zero) = (splat(x), splat(y), splat(across), splat(0.0));
    let (mut low, mut high) = (splat(f32::NEG_INFINITY), splat(f32::INFINITY));
    for i in (0..COUNT).step_by(8) {
        let at = |of: &[f32; COUNT]| f32x8::from_slice(simd, &of[i..i + 8]);
        let by_y = at(&hull.by_y);
        let enters = at(&hull.by_x).mul_add(x, at(&hull.first));
        let enters = by_y.mul_add(y, enters);
        // The first line's or the last one's.
        let aslant = by_y * across;
        low = low.max(enters + aslant.min(zero));
        high = high.min(enters + aslant.max(zero) + at(&hull.length));
    }
    [low.reduce_max(), high.reduce_min()]
}

/// One of every two opposite directions with coordinates up to 2.
fn normals() -> [DVec3; COUNT] {
    let coordinates = || [0i32, 1, 2, -1, -2].into_iter();
    let all = coordinates().flat_map(|i| coordinates().map(move |j| (i, j)));
    let all = all.flat_map(|(i, j)| coordinates().map(move |k| [i, j, k]));
    let positive = |n: &[i32; 3]| n.iter().find(|c| **c != 0).is_some_and(|c| *c > 0);
    let shortest = |n: &[i32; 3]| n.iter().any(|c| c % 2 != 0);
    let mut cycle = all
        .filter(|n| positive(n) && shortest(n))
        .map(|n| DVec3::from_array(n.map(f64::from)))
        .cycle();
    from_fn(|_| cycle.next().expect("there are directions"))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::vectors::{dispatch_lanes, native};

    const NODES: usize = 24;

    /// z values at which any corner of a cell is occupied, and those within the ranges, counted
    /// over all lines of a lattice around the field, `lines` at a time.
    fn count(values: &Array3<Complex<f32>>, rotation: DQuat, lines: usize) -> [usize; 2] {
        let step = DMat3::from_quat(rotation);
        let middle = DVec3::splat((NODES as f64 - 1.0) / 2.0);
        let size = 2 * NODES;
        let start = middle - step * DVec3::splat(size as f64 / 2.0);
        let hull = Hull::new(values, Interpolation::Trilinear).turned(start, &step);
        let occupied = |at: DVec3| {
            let cell = at.floor();
            (0..8).any(|c| {
                let corner =
                    cell + DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64);
                corner.min_element() >= 0.0
                    && values
                        .get(corner.to_array().map(|c| c as usize))
                        .is_some_and(|v| *v != Complex::default())
            })
        };
        let mut counts = [0; 2];
        for (x, y) in (0..size).flat_map(|x| (0..size).step_by(lines).map(move |y| (x, y))) {
            let within = 1..size - 1;
            let level = native();
            let range =
                dispatch_lanes!(level, simd => hull.range(simd, x, y, lines, within.clone()));
            assert!(range.start >= within.start && range.end <= within.end);
            counts[1] += lines * range.len();
            for (line, z) in (y..y + lines).flat_map(|y| within.clone().map(move |z| (y, z))) {
                if occupied(start + step * DVec3::new(x as f64, line as f64, z as f64)) {
                    assert!(range.contains(&z), "{rotation}: {x} {line} {z}: {range:?}");
                    counts[0] += 1;
                }
            }
        }
        counts
    }

    /// Ranges hold all that is occupied, whatever its shape. Around a ball they hold little more:
    /// 49 slabs some percent, and the corners of cells and the ends of groups of lines in
    /// proportion to its surface, which for a ball this small is a lot.
    #[test]
    fn ranges_hold_what_is_occupied_and_little_else() {
        let mut rng = SmallRng::seed_from_u64(8);
        let middle = DVec3::splat((NODES as f64 - 1.0) / 2.0);
        let field = |inside: &dyn Fn(DVec3) -> bool| {
            Array3::from_shape_fn([NODES; 3], |(i, j, k)| {
                let p = DVec3::new(i as f64, j as f64, k as f64) - middle;
                Complex::new(f32::from(u8::from(inside(p))), 0.0)
            })
        };
        let ball = field(&|p| p.length() < 11.0);
        let grains = field(&|p| (p - DVec3::new(5.0, -7.0, 2.0)).length() < 1.5 || p.x < -11.0);
        for turn in 0..6 {
            let mut c = || rng.random_range(-1.0..1.0);
            let rotation = match turn {
                0 => DQuat::IDENTITY,
                1 => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
                _ => DQuat::from_xyzw(c(), c(), c(), c()).normalize(),
            };
            count(&grains, rotation, 8);
            let [occupied, found] = count(&ball, rotation, 1);
            assert!(found < occupied * 5 / 4, "{occupied} {found}");
            let [occupied, found] = count(&ball, rotation, 8);
            assert!(found < occupied * 2, "{occupied} {found}");
        }
    }
}
