//! The sum at the heart of a query: 4 x 4 x 4 displacement nodes of each of up to 64 rotation
//! nodes.
//!
//! Weights along x and over rotations are applied while reading; those along y and z belong to the
//! lanes of a run (see [`crate::table::layout`]) and are applied once, at the end, by the caller.

use half::f16;

use crate::table::layout::RUN;

/// One rotation node to read: its numbers, and its weights in the value and in the slopes along the
/// three rotation coordinates.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RotationTap<'a> {
    pub(crate) codes: &'a [u16],
    pub(crate) weights: [f32; 4],
}

/// What every rotation node is read for.
#[derive(Debug, Clone)]
pub(crate) struct Stencil {
    /// Place of the run in a rotation node: by pencil along y, then by node along x.
    pub(crate) runs: [[usize; 4]; 2],
    /// Pencils that are read, 1 or 2.
    pub(crate) groups: usize,
    /// Weights along x of the value and of its slope.
    pub(crate) weights: [f32; 4],
    pub(crate) slopes: [f32; 4],
}

/// Sums over x and rotations, by lane `[z % 4][y % 4]` of a pencil.
pub(crate) type Lanes = [f32; RUN];

/// For each pencil: value, slope along x, slopes along the three rotation coordinates.
pub(crate) type Sums = [[Lanes; 5]; 2];

impl Stencil {
    /// Adds up what `taps` contribute.
    ///
    /// # Panics
    /// If a run reaches beyond a rotation node.
    #[inline]
    pub(crate) fn sum(&self, taps: &[RotationTap<'_>]) -> Sums {
        let furthest = self.runs.iter().flatten().max().copied().unwrap_or(0);
        let shortest = taps.iter().map(|t| t.codes.len()).min();
        assert!(shortest.is_none_or(|length| furthest + RUN <= length) && self.groups <= 2);
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the processor has AVX-512; every read lies within a rotation node by the
                // assertion.
                return unsafe { x86::sum_512(self, taps) };
            }
            if is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
                && is_x86_feature_detected!("f16c")
            {
                // SAFETY: as above with AVX2, FMA and F16C.
                return unsafe { x86::sum_256(self, taps) };
            }
        }
        self.sum_portable(taps)
    }

    /// Asks the processor to fetch what [`Stencil::sum`] will read.
    pub(crate) fn prefetch(&self, taps: &[RotationTap<'_>]) {
        #[cfg(target_arch = "x86_64")]
        for tap in taps {
            for run in self.runs.iter().take(self.groups).flatten() {
                // Runs of 32 bytes may reach into a second line.
                for part in [0, RUN - 1] {
                    if let Some(line) = tap.codes.get(run + part) {
                        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
                        // SAFETY: a hint, and about an element of a slice.
                        unsafe { _mm_prefetch::<_MM_HINT_T1>(std::ptr::from_ref(line).cast()) };
                    }
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = taps;
    }

    /// [`Stencil::sum`] for any processor.
    fn sum_portable(&self, taps: &[RotationTap<'_>]) -> Sums {
        let mut sums = Sums::default();
        for tap in taps {
            for (runs, sums) in self.runs.iter().zip(&mut sums).take(self.groups) {
                let (mut value, mut by_x) = (Lanes::default(), Lanes::default());
                for ((&run, weight), slope) in runs.iter().zip(self.weights).zip(self.slopes) {
                    let lanes = decode(&tap.codes[run..run + RUN]);
                    for l in 0..RUN {
                        value[l] += weight * lanes[l];
                        by_x[l] += slope * lanes[l];
                    }
                }
                let [w, a, b, c] = tap.weights;
                let terms = [
                    (w, &value),
                    (w, &by_x),
                    (a, &value),
                    (b, &value),
                    (c, &value),
                ];
                for (sum, (weight, term)) in sums.iter_mut().zip(terms) {
                    for l in 0..RUN {
                        sum[l] += weight * term[l];
                    }
                }
            }
        }
        sums
    }
}

/// Stored numbers as single precision.
fn decode(codes: &[u16]) -> Lanes {
    std::array::from_fn(|l| half_to_single(codes[l]))
}

/// Exponent and mantissa move into place and a product by 2^112 mends the exponent's bias;
/// infinities and NaN are not stored.
fn half_to_single(h: u16) -> f32 {
    let h = u32::from(h);
    let magnitude = f32::from_bits((h & 0x7fff) << 13) * f32::from_bits(0x7780_0000);
    f32::from_bits(magnitude.to_bits() | (h & 0x8000) << 16)
}

/// The number that a stored code stands for, in the table's unit.
pub(crate) fn value_of(code: u16) -> f64 {
    f16::from_bits(code).to_f64()
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{Lanes, RotationTap, Stencil, Sums};

    /// # Safety
    /// Needs AVX-512F. All runs must lie within the numbers of all taps.
    #[target_feature(enable = "avx512f,avx2,f16c")]
    pub(super) unsafe fn sum_512(stencil: &Stencil, taps: &[RotationTap<'_>]) -> Sums {
        let wide = |v: [f32; 4]| v.map(|x| _mm512_set1_ps(x));
        let (weights, slopes) = (wide(stencil.weights), wide(stencil.slopes));
        let mut sums = [[_mm512_setzero_ps(); 5]; 2];
        for tap in taps {
            let [w, a, b, c] = wide(tap.weights);
            for (runs, sums) in stencil.runs.iter().zip(&mut sums).take(stencil.groups) {
                let (mut value, mut by_x) = (_mm512_setzero_ps(), _mm512_setzero_ps());
                for s in 0..4 {
                    // SAFETY: the caller vouches for every run.
                    let codes =
                        unsafe { _mm256_loadu_si256(tap.codes.as_ptr().add(runs[s]).cast()) };
                    let lanes = _mm512_cvtph_ps(codes);
                    value = _mm512_fmadd_ps(weights[s], lanes, value);
                    by_x = _mm512_fmadd_ps(slopes[s], lanes, by_x);
                }
                sums[0] = _mm512_fmadd_ps(w, value, sums[0]);
                sums[1] = _mm512_fmadd_ps(w, by_x, sums[1]);
                sums[2] = _mm512_fmadd_ps(a, value, sums[2]);
                sums[3] = _mm512_fmadd_ps(b, value, sums[3]);
                sums[4] = _mm512_fmadd_ps(c, value, sums[4]);
            }
        }
        sums.map(|group| {
            group.map(|sum| {
                let mut lanes = Lanes::default();
                // SAFETY: 16 numbers into 16 numbers.
                unsafe { _mm512_storeu_ps(lanes.as_mut_ptr(), sum) };
                lanes
            })
        })
    }

    /// # Safety
    /// Needs AVX2, FMA and F16C. All runs must lie within the numbers of all taps.
    #[target_feature(enable = "avx2,fma,f16c")]
    pub(super) unsafe fn sum_256(stencil: &Stencil, taps: &[RotationTap<'_>]) -> Sums {
        let wide = |v: [f32; 4]| v.map(|x| _mm256_set1_ps(x));
        let (weights, slopes) = (wide(stencil.weights), wide(stencil.slopes));
        let mut out = Sums::default();
        for (group, out) in stencil.runs.iter().zip(&mut out).take(stencil.groups) {
            for half in 0..2 {
                let mut sums = [_mm256_setzero_ps(); 5];
                for tap in taps {
                    let [w, a, b, c] = wide(tap.weights);
                    let (mut value, mut by_x) = (_mm256_setzero_ps(), _mm256_setzero_ps());
                    for s in 0..4 {
                        // SAFETY: the caller vouches for every run.
                        let codes = unsafe {
                            let run = tap.codes.as_ptr().add(group[s] + 8 * half);
                            _mm_loadu_si128(run.cast())
                        };
                        let lanes = _mm256_cvtph_ps(codes);
                        value = _mm256_fmadd_ps(weights[s], lanes, value);
                        by_x = _mm256_fmadd_ps(slopes[s], lanes, by_x);
                    }
                    sums[0] = _mm256_fmadd_ps(w, value, sums[0]);
                    sums[1] = _mm256_fmadd_ps(w, by_x, sums[1]);
                    sums[2] = _mm256_fmadd_ps(a, value, sums[2]);
                    sums[3] = _mm256_fmadd_ps(b, value, sums[3]);
                    sums[4] = _mm256_fmadd_ps(c, value, sums[4]);
                }
                for (out, sum) in out.iter_mut().zip(sums) {
                    out[8 * half..][..8].copy_from_slice(&bytemuck::cast::<__m256, [f32; 8]>(sum));
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn decoding_is_exact_for_all_normal_numbers() {
        for bits in 0..=u16::MAX {
            let half = f16::from_bits(bits);
            if half.is_finite() {
                assert_eq!(decode(&[bits; RUN]), [half.to_f32(); RUN]);
            }
        }
    }

    /// The definition, in double precision.
    fn plain_sums(stencil: &Stencil, taps: &[RotationTap<'_>]) -> [[[f64; RUN]; 5]; 2] {
        let mut sums = [[[0f64; RUN]; 5]; 2];
        for tap in taps {
            for (g, sums) in sums.iter_mut().enumerate().take(stencil.groups) {
                for (s, l) in (0..4).flat_map(|s| (0..RUN).map(move |l| (s, l))) {
                    let e = value_of(tap.codes[stencil.runs[g][s] + l]);
                    let [w, a, b, c] = tap.weights.map(f64::from);
                    let (x, dx) = (stencil.weights[s], stencil.slopes[s]);
                    let (x, dx) = (f64::from(x), f64::from(dx));
                    let factors = [w * x, w * dx, a * x, b * x, c * x];
                    for (sum, f) in sums.iter_mut().zip(factors) {
                        sum[l] += f * e;
                    }
                }
            }
        }
        sums
    }

    /// Every way of summing against plain sums in double precision: single precision errs by
    /// 6e-8 of the sum of magnitudes per addition, of which there are a few hundred.
    #[test]
    fn sums_agree_with_double_precision() {
        let mut rng = SmallRng::seed_from_u64(1);
        let (length, rows) = (96, 9);
        for (groups, count) in [(1, 5), (2, 64), (2, 33), (1, 0)] {
            let mut weight = || rng.random_range(-1.0f32..1.0);
            let (weights, slopes) = (
                std::array::from_fn(|_| weight()),
                std::array::from_fn(|_| weight()),
            );
            let energies: Vec<u16> = (0..length * rows)
                .map(|_| f16::from_f32(500.0 * weight()).to_bits())
                .collect();
            let taps: Vec<RotationTap> = (0..count)
                .map(|k| RotationTap {
                    codes: &energies[k % rows * length..][..length],
                    weights: std::array::from_fn(|_| weight()),
                })
                .collect();
            let stencil = Stencil {
                runs: [[0, 17, 80, 3], [64, 5, 5, 79]],
                groups,
                weights,
                slopes,
            };
            let expected = plain_sums(&stencil, &taps);
            let mut found = vec![stencil.sum(&taps), stencil.sum_portable(&taps)];
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("f16c") {
                // SAFETY: the features are there, and the runs above end within 96 numbers.
                found.push(unsafe { x86::sum_256(&stencil, &taps) });
            }
            for sums in found {
                for (found, expected) in sums.iter().flatten().zip(expected.iter().flatten()) {
                    for (a, b) in found.iter().zip(expected) {
                        assert!((f64::from(*a) - b).abs() < 1e-2, "{a} {b}");
                    }
                }
            }
        }
    }
}
