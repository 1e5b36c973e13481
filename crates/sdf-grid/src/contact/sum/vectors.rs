//! Vectors for sixteen samples.

use fearless_simd::{f32x16, prelude::*};
use glam::{Mat3, Vec3};

use super::lanes::Lanes;

/// One vector per sample.
pub(super) type Vectors<S> = [f32x16<S>; 3];

#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, value: f32) -> f32x16<S> {
    f32x16::splat(simd, value)
}

/// Components along three axes.
#[inline(always)]
pub(super) fn along<S: Simd>(of: &Vectors<S>, axes: &[Vec3; 3]) -> Vectors<S> {
    [dot(of, axes[0]), dot(of, axes[1]), dot(of, axes[2])]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(a: &Vectors<S>, b: Vec3) -> f32x16<S> {
    let simd = a[0].token();
    let z = a[2] * b.z;
    a[0].mul_add(splat(simd, b.x), a[1].mul_add(splat(simd, b.y), z))
}

#[inline(always)]
pub(super) fn inner<S: Simd>(a: &Vectors<S>, b: &Vectors<S>) -> f32x16<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(super) fn scaled<S: Simd>(a: &Vectors<S>, by: f32x16<S>) -> Vectors<S> {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
pub(super) fn turned<S: Simd>(simd: S, turn: &Mat3, v: &[Lanes; 3]) -> Vectors<S> {
    let v = [
        f32x16::simd_from(simd, v[0]),
        f32x16::simd_from(simd, v[1]),
        f32x16::simd_from(simd, v[2]),
    ];
    [
        dot(&v, turn.row(0)),
        dot(&v, turn.row(1)),
        dot(&v, turn.row(2)),
    ]
}
