//! Which vector instructions run: the crate's one choice of them.

use fearless_simd::Level;

/// What this machine has; with the feature `scalar` no vector instructions at all.
pub(crate) fn native() -> Level {
    #[cfg(feature = "scalar")]
    return Level::fallback();
    #[cfg(not(feature = "scalar"))]
    Level::new()
}

/// This machine's best vectors, those before them, and those that every machine of its kind has.
#[cfg(test)]
pub(crate) fn levels() -> Vec<Level> {
    let best = native();
    #[cfg(feature = "scalar")]
    return vec![best];
    #[cfg(not(feature = "scalar"))]
    {
        #[cfg(target_arch = "x86_64")]
        let before = best.as_avx2().map(Level::Avx2);
        #[cfg(not(target_arch = "x86_64"))]
        let before = None;
        let others = before.into_iter().chain([Level::baseline()]);
        [best].into_iter().chain(others).collect()
    }
}

/// Runs an expression with the vectors of a level: `fearless_simd::dispatch!` without the levels
/// between the baseline and AVX2, of which no machine in use is the best.
macro_rules! dispatch_lanes {
    ($level:expr, $simd:ident => $op:expr) => {{
        #[cfg(all(target_arch = "x86_64", not(feature = "scalar")))]
        {
            use fearless_simd::Simd as _;
            let level: fearless_simd::Level = $level;
            if let Some($simd) = level.as_avx512() {
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            } else if let Some($simd) = level.as_avx2() {
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            } else {
                let $simd = level.as_sse2().expect("every x86-64 machine has SSE2");
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            }
        }
        #[cfg(not(all(target_arch = "x86_64", not(feature = "scalar"))))]
        {
            fearless_simd::dispatch!($level, $simd => $op)
        }
    }};
}

pub(crate) use dispatch_lanes;
