use std::ops::Range;

use fearless_simd::{Level, prelude::*};
use ndarray::{Array3, ArrayView3, Axis};
use num_complex::Complex;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use super::{Fused, FusedScratch, correlate};
use crate::correlate::contract::{MovingRows, Sizes};
use crate::correlate::fixtures;
use crate::correlate::real::Real;
use crate::geometry::half_turn::HalfTurn;
use crate::vectors::levels;

type Field = Array3<Complex<f64>>;

/// A moving field as it is.
struct Still<'a>(&'a Field);

impl<T: Real> MovingRows<T> for Still<'_> {
    fn bounds(&self) -> [Range<usize>; 3] {
        let (x, y, z) = self.0.dim();
        [0..x, 0..y, 0..z]
    }

    fn fill_lanes<S: Simd>(&self, _: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize> {
        let lanes = T::Native::<S>::LEN;
        let (_, ny, nz) = self.0.dim();
        for (z, element) in bundle.chunks_exact_mut(2 * lanes).enumerate().take(nz) {
            for lane in 0..lanes {
                let inside = y + lane < ny;
                let v = if inside {
                    self.0[[x, y + lane, z]]
                } else {
                    Complex::default()
                };
                element[lane] = T::nearest(v.re);
                element[lanes + lane] = T::nearest(v.im);
            }
        }
        0..nz
    }
}

/// Fields with values of order one, which f32 holds exactly.
fn random(shape: [usize; 3], rng: &mut SmallRng) -> Field {
    Array3::from_shape_simple_fn(shape, || {
        let mut part = || f64::from(rng.random_range(-1.0..1.0f32));
        Complex::new(part(), part())
    })
}

/// The kernels' sum over all pairs of fixed fields, in periodic boxes of one size, and moving ones;
/// for each of `turns` or, without, as it is.
fn kernels<T: Real>(
    level: Level,
    pairs: &[(Field, Field)],
    window: [usize; 3],
    turns: &[HalfTurn],
) -> Vec<Array3<f64>> {
    let sizes = Sizes {
        transform: pairs[0].0.dim().into(),
        window,
        moving: pairs.iter().map(|p| p.1.dim().into()).collect(),
        half_turns: !turns.is_empty(),
    };
    let narrow = |v: &Complex<f64>| Complex::new(T::nearest(v.re), T::nearest(v.im));
    let fused = Fused::<T>::new(level, sizes, |term| pairs[term].0.map(narrow));
    let moving: Vec<_> = pairs.iter().map(|p| Still(&p.1)).collect();
    let mut outs = vec![Array3::from_elem(window, T::nearest(f64::NAN)); turns.len().max(1)];
    let mut views: Vec<_> = outs.iter_mut().map(|out| out.view_mut()).collect();
    correlate(
        &fused,
        &moving,
        turns,
        &mut FusedScratch::new(&fused),
        &mut views,
    );
    outs.iter().map(|out| out.map(|v| (*v).into())).collect()
}

/// The sum over all pairs by the reference.
fn exact(pairs: &[(Field, Field)], window: [usize; 3]) -> Array3<f64> {
    let of = |(fixed, moving): &(Field, Field)| fixtures::correlate(fixed.clone(), moving, window);
    pairs.iter().map(of).reduce(|a, b| a + b).expect("a pair")
}

/// Relative L2 distance.
fn distance(found: &Array3<f64>, exact: &Array3<f64>) -> f64 {
    let wrong: f64 = found.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
    (wrong / exact.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

/// A random pair in a box of this size, with the largest window into which nothing wraps around.
fn pair(size: [usize; 3], moving: [usize; 3], rng: &mut SmallRng) -> ((Field, Field), [usize; 3]) {
    let window = std::array::from_fn(|a| size[a] + 1 - moving[a]);
    ((random(size, rng), random(moving, rng)), window)
}

/// Of transforms of odd, prime and composite lengths.
#[test]
fn the_reference_equals_the_definition() {
    let mut rng = SmallRng::seed_from_u64(2);
    for size in [[2, 3, 5], [7, 4, 11], [1, 13, 6], [9, 1, 1]] {
        let moving = size.map(|n| rng.random_range(1..=n));
        let ((a, b), window) = pair(size, moving, &mut rng);
        let found = fixtures::correlate(a.clone(), &b, window);
        let sum = |n: [usize; 3]| -> f64 {
            let met = |at: (usize, usize, usize)| a[[at.0 + n[0], at.1 + n[1], at.2 + n[2]]];
            b.indexed_iter().map(|(at, v)| (met(at) * v).re).sum()
        };
        for ((i, j, k), found) in found.indexed_iter() {
            assert!(
                (found - sum([i, j, k])).abs() < 1e-13,
                "{size:?} {moving:?}"
            );
        }
    }
}

/// The kernels in f32 and f64, with this machine's vectors and with those that every machine of its
/// kind has, with one pair and with two. The two ways differ in rounding only.
#[test]
fn kernels_equal_the_reference() {
    let mut rng = SmallRng::seed_from_u64(5);
    let mut sizes = vec![[4, 6, 8], [1, 1, 6], [5, 8, 2], [9, 3, 20]];
    if !cfg!(miri) {
        let large = [
            [30, 36, 48],
            [64, 50, 40],
            [45, 64, 72],
            [81, 27, 60],
            [96, 100, 2],
            [1, 1, 90],
        ];
        sizes.extend(large);
    }
    for size in sizes {
        let moving = size.map(|n| rng.random_range(1..=n));
        let (first, window) = pair(size, moving, &mut rng);
        let (second, _) = pair(size, moving, &mut rng);
        for pairs in [vec![first.clone()], vec![first, second]] {
            let exact = exact(&pairs, window);
            for level in levels() {
                let e = distance(&kernels::<f32>(level, &pairs, window, &[])[0], &exact);
                assert!(e < 1e-6, "{size:?} {moving:?}: {e}");
                let e = distance(&kernels::<f64>(level, &pairs, window, &[])[0], &exact);
                assert!(e < 2e-15, "{size:?} {moving:?}: {e}");
            }
        }
    }
}

/// A moving field that is turned by a half turn is the same field, read backwards along two axes.
#[test]
fn half_turns_equal_the_reference_of_flipped_fields() {
    let mut rng = SmallRng::seed_from_u64(6);
    let mut sizes = vec![([4, 6, 8], [2, 3, 4]), ([5, 4, 6], [3, 2, 5])];
    if !cfg!(miri) {
        sizes.extend([([32, 30, 36], [16, 11, 20]), ([40, 64, 24], [9, 30, 12])]);
    }
    for (size, moving) in sizes {
        let (first, window) = pair(size, moving, &mut rng);
        let (second, _) = pair(size, moving, &mut rng);
        for pairs in [vec![first.clone()], vec![first, second]] {
            for level in levels() {
                let found = kernels::<f64>(level, &pairs, window, &HalfTurn::ALL);
                for (found, turn) in found.iter().zip(HalfTurn::ALL) {
                    let flipped = |(a, b): &(Field, Field)| (a.clone(), flip(b.view(), turn));
                    let pairs: Vec<_> = pairs.iter().map(flipped).collect();
                    let e = distance(found, &exact(&pairs, window));
                    assert!(e < 2e-15, "{size:?} {moving:?} {turn:?}: {e}");
                }
            }
        }
    }
}

fn flip(mut field: ArrayView3<Complex<f64>>, turn: HalfTurn) -> Field {
    for axis in (0..3).filter(|a| turn.flips()[*a]) {
        field.invert_axis(Axis(axis));
    }
    field.as_standard_layout().into_owned()
}
