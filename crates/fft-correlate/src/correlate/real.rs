//! The number types that a correlation can be computed in.

use bytemuck::Pod;
use fearless_simd::{SimdFloat, SimdFloatElement, f32x4, f32x8, f64x4, f64x8, i32x8, prelude::*};
use num_traits::{FromPrimitive, Signed};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32`, in which scores are computed, or `f64`, in which they are verified by the same code.
pub trait Real:
    sealed::Sealed
    + SimdFloatElement
    + FromPrimitive
    + Signed
    + std::fmt::Debug
    + Pod
    + Default
    + PartialOrd
    + Into<f64>
{
    /// Four numbers.
    #[doc(hidden)]
    type Quad<S: Simd>: SimdFloat<S, Element = Self> + SimdCombine<S, Combined = Self::Eight<S>>;

    /// Eight numbers.
    #[doc(hidden)]
    type Eight<S: Simd>: SimdFloat<S, Element = Self> + SimdSplit<S, Split = Self::Quad<S>>;

    /// The nearest number of this type.
    fn nearest(value: f64) -> Self;

    /// `base + cell[0] strides[0] + cell[1] strides[1] + cell[2]` for eight cells of whole
    /// coordinates, at least 0 and at most `last`.
    #[doc(hidden)]
    fn places<S: Simd>(
        simd: S,
        cells: [Self::Eight<S>; 3],
        strides: [i32; 2],
        base: i32,
        last: i32,
    ) -> [i32; 8];
}

impl Real for f32 {
    type Quad<S: Simd> = f32x4<S>;
    type Eight<S: Simd> = f32x8<S>;

    #[inline(always)]
    fn places<S: Simd>(
        simd: S,
        cells: [f32x8<S>; 3],
        strides: [i32; 2],
        base: i32,
        last: i32,
    ) -> [i32; 8] {
        let x = cells[0].to_int::<i32x8<S>>();
        let y = cells[1].to_int::<i32x8<S>>();
        let z = cells[2].to_int::<i32x8<S>>();
        let rows = x * i32x8::splat(simd, strides[0]) + y * i32x8::splat(simd, strides[1]);
        let place = rows + (z + i32x8::splat(simd, base));
        let (first, last) = (i32x8::splat(simd, 0), i32x8::splat(simd, last));
        place.max(first).min(last).into()
    }

    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value as f32
    }
}

impl Real for f64 {
    type Quad<S: Simd> = f64x4<S>;
    type Eight<S: Simd> = f64x8<S>;

    #[inline(always)]
    fn places<S: Simd>(
        _: S,
        cells: [f64x8<S>; 3],
        strides: [i32; 2],
        base: i32,
        last: i32,
    ) -> [i32; 8] {
        let mut places = [base; 8];
        for (i, place) in places.iter_mut().enumerate() {
            for (cell, stride) in cells.iter().zip([strides[0], strides[1], 1]) {
                let cell = cell.as_slice()[i] as i32;
                *place = place.wrapping_add(cell.wrapping_mul(stride));
            }
            *place = (*place).max(0).min(last);
        }
        places
    }

    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value
    }
}
