//! The number types that a correlation can be computed in.

use bytemuck::Pod;
use fearless_simd::{SimdFloat, SimdFloatElement, f32x4, f64x4, i32x4, prelude::*};
use rustfft::FftNum;

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32`, in which scores are computed, or `f64`, in which they are verified by the same code.
pub trait Real:
    sealed::Sealed + SimdFloatElement + FftNum + Pod + Default + PartialOrd + Into<f64>
{
    /// Four numbers.
    #[doc(hidden)]
    type Quad<S: Simd>: SimdFloat<S, Element = Self>;

    /// The nearest number of this type.
    fn nearest(value: f64) -> Self;

    /// Whole numbers below 2^31 as integers.
    #[doc(hidden)]
    fn integers<S: Simd>(values: Self::Quad<S>) -> [i32; 4];
}

impl Real for f32 {
    type Quad<S: Simd> = f32x4<S>;

    #[inline(always)]
    fn integers<S: Simd>(values: f32x4<S>) -> [i32; 4] {
        values.to_int::<i32x4<S>>().into()
    }

    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value as f32
    }
}

impl Real for f64 {
    type Quad<S: Simd> = f64x4<S>;

    #[inline(always)]
    fn integers<S: Simd>(values: f64x4<S>) -> [i32; 4] {
        let values: [f64; 4] = values.into();
        values.map(|v| v as i32)
    }

    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value
    }
}
