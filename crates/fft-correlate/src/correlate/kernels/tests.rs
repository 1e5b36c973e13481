//! Windowed correlation of two plain complex arrays: the machinery of [`crate::Correlator`]
//! without rotation, for tests, tools and comparison with other programs.

use std::ops::Range;

use fearless_simd::prelude::*;
use ndarray::{Array3, ArrayView3};
use num_complex::{Complex, Complex32};

use crate::CorrelateError;
use crate::correlate::{periodic, transform_size};
use crate::overlap::{IndexBox, overlap};
use crate::real::Real;
use crate::spectral::{FixedTerm, MovingRows, Spectral, Way};

/// `Re sum_i a[i] b[i - n]` for every integer displacement `n` with `first <= n < first + shape`,
/// without wrap-around: indices outside an array count as zero. No conjugate. Element `[0, 0, 0]`
/// of the result belongs to `n = first`.
///
/// # Errors
/// If the transform would exceed [`crate::Correlator::MAX_POINTS`].
pub fn correlate_fields(
    a: ArrayView3<Complex32>,
    b: ArrayView3<Complex32>,
    first: [i64; 3],
    shape: [usize; 3],
) -> Result<Array3<f32>, CorrelateError> {
    let box_of = |v: &ArrayView3<Complex32>| IndexBox::of_shape([v.dim().0, v.dim().1, v.dim().2]);
    let window = IndexBox {
        lo: first,
        hi: std::array::from_fn(|axis| first[axis] + shape[axis] as i64),
    };
    let mut out = Array3::zeros(shape);
    let Some(met) = overlap(box_of(&a), box_of(&b), window) else {
        return Ok(out);
    };
    let size = transform_size([met.min_period].into_iter(), shape, &[met.moving.shape()])?;
    correlate_with_size(Way::native(), a, b, first, size, &mut out);
    Ok(out)
}

/// [`correlate_fields`] with a transform size of the caller's choice, which must be long enough.
fn correlate_with_size<T: Real>(
    way: Way,
    a: ArrayView3<Complex32>,
    b: ArrayView3<Complex32>,
    first: [i64; 3],
    size: [usize; 3],
    out: &mut Array3<T>,
) {
    let shape = [out.dim().0, out.dim().1, out.dim().2];
    let box_of = |v: &ArrayView3<Complex32>| IndexBox::of_shape([v.dim().0, v.dim().1, v.dim().2]);
    let window = IndexBox {
        lo: first,
        hi: std::array::from_fn(|axis| first[axis] + shape[axis] as i64),
    };
    let Some(met) = overlap(box_of(&a), box_of(&b), window) else {
        return;
    };
    let term = FixedTerm {
        field: periodic(
            &a.to_owned(),
            &met.fixed,
            met.moving.lo,
            first,
            size,
            T::one(),
        ),
        moving_shape: met.moving.shape(),
    };
    let spectral = Spectral::new(way, size, shape, vec![term], false);
    let rows = Still {
        values: b,
        within: met.moving,
    };
    spectral.correlate(&[rows], &[], &mut spectral.scratch(), &mut [out.view_mut()]);
}

/// An array as it is, cropped.
struct Still<'a> {
    values: ArrayView3<'a, Complex32>,
    within: IndexBox,
}

impl<T: Real> MovingRows<T> for Still<'_> {
    fn bounds(&self) -> [Range<usize>; 3] {
        self.within.shape().map(|s| 0..s)
    }

    fn fill(&self, x: usize, y: usize, row: &mut [Complex<T>]) -> bool {
        let wanted = row.iter_mut().take(self.within.shape()[2]);
        for (z, value) in wanted.enumerate() {
            *value = self.at(x, y, z);
        }
        true
    }

    fn fill_lanes<S: Simd>(&self, _: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize> {
        let lanes = T::Native::<S>::LEN;
        let [_, ny, nz] = self.within.shape();
        for (z, element) in bundle.chunks_exact_mut(2 * lanes).enumerate().take(nz) {
            for lane in 0..lanes {
                let value = if y + lane < ny {
                    self.at(x, y + lane, z)
                } else {
                    Complex::default()
                };
                element[lane] = value.re;
                element[lanes + lane] = value.im;
            }
        }
        0..nz
    }
}

impl Still<'_> {
    fn at<T: Real>(&self, x: usize, y: usize, z: usize) -> Complex<T> {
        let [i, j, k] = self.within.lo.map(|lo| lo as usize);
        let v = self.values[[i + x, j + y, k + z]];
        Complex::new(T::nearest(v.re.into()), T::nearest(v.im.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::Level;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    fn random(shape: [usize; 3], rng: &mut SmallRng) -> Array3<Complex32> {
        Array3::from_shape_simple_fn(shape, || {
            Complex32::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
        })
    }

    /// The definition, in double precision, element by element.
    fn brute(a: &Array3<Complex32>, b: &Array3<Complex32>, first: [i64; 3], n: [usize; 3]) -> f64 {
        let mut sum = 0.0;
        for ((i, j, k), v) in a.indexed_iter() {
            let at = [i, j, k];
            let from: [usize; 3] = std::array::from_fn(|c| {
                usize::try_from(at[c] as i64 - (first[c] + n[c] as i64)).unwrap_or(usize::MAX)
            });
            if let Some(u) = b.get(from) {
                sum += v.re as f64 * u.re as f64 - v.im as f64 * u.im as f64;
            }
        }
        sum
    }

    /// Relative L2 error against the definition at up to 100 random displacements.
    fn error(
        a: &Array3<Complex32>,
        b: &Array3<Complex32>,
        first: [i64; 3],
        found: &Array3<f32>,
        rng: &mut SmallRng,
    ) -> f64 {
        let shape = [found.dim().0, found.dim().1, found.dim().2];
        let (mut wrong, mut size) = (0.0, 0.0);
        for _ in 0..100.min(found.len()) {
            let n = shape.map(|s| rng.random_range(0..s));
            let exact = brute(a, b, first, n);
            wrong += (found[n] as f64 - exact).powi(2);
            size += exact * exact;
        }
        // Where few elements meet, the error is measured against products of order one.
        (wrong / size.max(0.1 * found.len().min(100) as f64)).sqrt()
    }

    /// f32 transforms are good to about 1e-7 times the square root of log2 of the size; 1e-5
    /// leaves room for windows that see only small sums.
    const TOLERANCE: f64 = 1e-5;

    #[test]
    fn equals_the_direct_sum_for_all_sizes_from_2_to_40() {
        let mut rng = SmallRng::seed_from_u64(1);
        for size in 2..=40usize {
            let other = |rng: &mut SmallRng| rng.random_range(2..=40usize);
            let mut shape = [size, other(&mut rng), other(&mut rng)];
            shape.rotate_right(size % 3);
            let a = random(shape, &mut rng);
            let b = random(shape.map(|s| rng.random_range(1..=s + 3)), &mut rng);
            // Every displacement at which the two meet, and one beyond on each side.
            let (sa, sb) = (a.shape(), b.shape());
            let first = std::array::from_fn(|c| -(sb[c] as i64));
            let window = std::array::from_fn(|c| sa[c] + sb[c] + 1);
            let found = correlate_fields(a.view(), b.view(), first, window).unwrap();
            let e = error(&a, &b, first, &found, &mut rng);
            assert!(e < TOLERANCE, "{shape:?} {sb:?}: {e}");
        }
    }

    /// The shortest period without wrap is used as it is, so that odd, prime and composite lengths
    /// all occur, with windows anywhere.
    #[test]
    fn any_transform_length_works_and_nothing_wraps() {
        let mut rng = SmallRng::seed_from_u64(2);
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..60 {
            let a = random([0; 3].map(|_| rng.random_range(2..=25)), &mut rng);
            let b = random([0; 3].map(|_| rng.random_range(2..=25)), &mut rng);
            let first = [0; 3].map(|_| rng.random_range(-20..15));
            let shape = [0; 3].map(|_| rng.random_range(1..20usize));
            let window = IndexBox {
                lo: first,
                hi: std::array::from_fn(|c| first[c] + shape[c] as i64),
            };
            let of = |v: &Array3<Complex32>| IndexBox::of_shape(v.dim().into());
            let Some(met) = overlap(of(&a), of(&b), window) else {
                continue;
            };
            seen.extend(met.min_period);
            let mut found = Array3::zeros(shape);
            correlate_with_size(
                Way::native(),
                a.view(),
                b.view(),
                first,
                met.min_period,
                &mut found,
            );
            let e = error(&a, &b, first, &found, &mut rng);
            assert!(e < TOLERANCE, "{met:?}: {e}");
        }
        let primes = [7, 11, 13, 17, 19, 23, 29, 31];
        assert!(
            primes.iter().filter(|p| seen.contains(p)).count() >= 5,
            "{seen:?}"
        );
    }

    /// Larger fields than the definition can be summed over, of random sizes and windows: the
    /// kernels in f32 and f64, with this machine's vectors and with those that every machine of
    /// its kind has, against rustfft and realfft in f64. The two differ in rounding only.
    #[test]
    fn kernels_equal_the_reference() {
        let mut rng = SmallRng::seed_from_u64(5);
        let sizes = [
            [30, 36, 48],
            [64, 50, 40],
            [45, 64, 72],
            [81, 27, 60],
            [96, 100, 2],
            [1, 1, 90],
        ];
        for size in sizes {
            let moving = size.map(|n| rng.random_range(1..=n));
            let shape: [usize; 3] = std::array::from_fn(|a| size[a] + 1 - moving[a]);
            let fixed: [usize; 3] = std::array::from_fn(|a| moving[a] + shape[a] - 1);
            let (a, b) = (random(fixed, &mut rng), random(moving, &mut rng));
            let mut exact = Array3::<f64>::zeros(shape);
            let first = [0; 3];
            correlate_with_size(Way::Reference, a.view(), b.view(), first, size, &mut exact);
            let scale = exact.iter().map(|v| v * v).sum::<f64>();
            for level in [Level::new(), Level::baseline()] {
                let way = Way::Fastest(level);
                let mut single = Array3::<f32>::zeros(shape);
                correlate_with_size(way, a.view(), b.view(), first, size, &mut single);
                let wrong = |v: &f64, w: f64| (v - w).powi(2);
                let of = |v: Vec<f64>| exact.iter().zip(v).map(|(e, v)| wrong(e, v)).sum::<f64>();
                let e = (of(single.iter().map(|v| f64::from(*v)).collect()) / scale).sqrt();
                assert!(e < 1e-6, "{size:?} {moving:?}: {e}");
                let mut double = Array3::<f64>::zeros(shape);
                correlate_with_size(way, a.view(), b.view(), first, size, &mut double);
                let e = (of(double.into_iter().collect()) / scale).sqrt();
                assert!(e < 2e-15, "{size:?} {moving:?}: {e}");
            }
        }
    }

    #[test]
    fn an_impulse_reads_the_other_field() {
        let mut rng = SmallRng::seed_from_u64(3);
        let a = random([9, 8, 7], &mut rng);
        let mut b = Array3::zeros([3, 3, 3]);
        b[[1, 2, 0]] = Complex32::new(0.0, 2.0);
        let found = correlate_fields(a.view(), b.view(), [-1, -2, 0], [9, 8, 7]).unwrap();
        for (f, v) in found.iter().zip(&a) {
            assert!((f + 2.0 * v.im).abs() < 1e-5);
        }
    }

    #[test]
    fn fields_out_of_reach_give_zero_and_huge_windows_are_refused() {
        let a = Array3::from_elem([3, 3, 3], Complex32::new(1.0, 0.0));
        let far = correlate_fields(a.view(), a.view(), [10, 0, 0], [4, 2, 2]).unwrap();
        assert!(far.iter().all(|v| *v == 0.0));
        let line = Array3::from_elem([1 << 11, 1, 1], Complex32::new(1.0, 0.0));
        let plane = Array3::from_elem([1, 1 << 10, 1 << 10], Complex32::new(1.0, 0.0));
        let refused = correlate_fields(line.view(), plane.view(), [0; 3], [1, 1, 1]);
        assert!(refused.is_ok(), "cropping leaves one row");
    }
}
