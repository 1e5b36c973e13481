//! The choice of vector instructions.

use fearless_simd::Level;

/// The best level of this machine; with the feature `scalar`, no vector instructions at all.
///
/// Unit tests are compiled for AVX2 and the baseline only: every level costs as long again to
/// compile, and the crates' other tests compare what the machine's best gives with references.
pub fn native() -> Level {
    #[cfg(feature = "scalar")]
    return Level::fallback();
    #[cfg(not(feature = "scalar"))]
    Level::new()
}

/// AVX2 where the machine has it.
#[cfg(all(target_arch = "x86_64", not(feature = "scalar")))]
pub fn before_last() -> Option<Level> {
    native().as_avx2().map(Level::Avx2)
}

/// AVX2 where the machine has it.
#[cfg(not(all(target_arch = "x86_64", not(feature = "scalar"))))]
pub fn before_last() -> Option<Level> {
    None
}

/// This machine's best vectors of those compiled into unit tests, and those that every machine of
/// its kind has.
pub fn tested() -> Vec<Level> {
    let best = before_last().unwrap_or_else(native);
    #[cfg(feature = "scalar")]
    return vec![best];
    #[cfg(not(feature = "scalar"))]
    vec![best, Level::baseline()]
}

/// Runs an expression with the vectors of a level: `fearless_simd::dispatch!` without the levels
/// between the baseline and AVX2, of which no machine in use is the best.
#[cfg(all(target_arch = "x86_64", not(feature = "scalar")))]
#[doc(hidden)]
#[macro_export]
macro_rules! dispatch_lanes {
    ($level:expr, $simd:ident => $op:expr) => {{
        use fearless_simd::Simd as _;
        let level: fearless_simd::Level = $level;
        $crate::dispatch_last!(level, $simd => $op, {
            if let Some($simd) = level.as_avx2() {
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            } else {
                $crate::dispatch_baseline!(level, $simd => $op)
            }
        })
    }};
}

/// [`dispatch_lanes`] for the baseline. Of builds with debug assertions only unit tests have it: other
/// tests run on machines that have AVX2, and each level costs as long again to compile.
#[cfg(all(target_arch = "x86_64", not(feature = "scalar")))]
#[doc(hidden)]
#[macro_export]
macro_rules! dispatch_baseline {
    ($level:ident, $simd:ident => $op:expr) => {{
        #[cfg(any(test, not(debug_assertions)))]
        {
            let $simd = $level.as_sse2().expect("every x86-64 machine has SSE2");
            $simd.vectorize(
                #[inline(always)]
                || $op,
            )
        }
        #[cfg(all(debug_assertions, not(test)))]
        panic!("a build with debug assertions needs a processor with AVX2; build with --release")
    }};
}

/// [`dispatch_lanes`] for AVX-512, which unit tests leave out: `cfg` is that of the crate that runs
/// it.
#[cfg(all(target_arch = "x86_64", not(feature = "scalar")))]
#[doc(hidden)]
#[macro_export]
macro_rules! dispatch_last {
    ($level:ident, $simd:ident => $op:expr, $before:expr) => {{
        #[cfg(not(test))]
        if let Some($simd) = $level.as_avx512() {
            $simd.vectorize(
                #[inline(always)]
                || $op,
            )
        } else {
            $before
        }
        #[cfg(test)]
        $before
    }};
}

/// Runs an expression with the vectors of a level.
#[cfg(not(all(target_arch = "x86_64", not(feature = "scalar"))))]
#[doc(hidden)]
#[macro_export]
macro_rules! dispatch_lanes {
    ($level:expr, $simd:ident => $op:expr) => {{
        fearless_simd::dispatch!($level, $simd => $op)
    }};
}
