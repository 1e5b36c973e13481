//! Places above a torus, unrolled, for sixteen samples.

use fearless_simd::{f32x16, prelude::*};
use glam::{Vec2, Vec3};

use super::circle::{Circle, circle};
use super::sheet::Sheet;
use super::vectors::{Vectors, inner, splat};

/// Samples above a torus; vectors are along the axes of its sheet.
pub(super) struct Unrolled<S: Simd> {
    pub(super) height: f32x16<S>,
    /// The feet, unrolled.
    pub(super) place: [f32x16<S>; 2],
    /// Where the height grows, and where both places do; of unit length.
    pub(super) normal: Vectors<S>,
    pub(super) x: Vectors<S>,
    pub(super) y: Vectors<S>,
    /// Slopes of places with lengths along these.
    pub(super) shrunk: [f32x16<S>; 2],
    /// Slopes of the normal with lengths along these.
    pub(super) bent: [f32x16<S>; 2],
}

impl<S: Simd> Unrolled<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, curvature: Vec2, [x, y, z]: Vectors<S>) -> Self {
        let zero = splat(simd, 0.0);
        let b = Circle::new(y, z, curvature.y);
        let a = Circle::new(x, b.height, curvature.x);
        Self {
            height: a.height,
            place: [a.place, b.place],
            normal: [a.sine, a.cosine * b.sine, a.cosine * b.cosine],
            x: [a.cosine, zero - a.sine * b.sine, zero - a.sine * b.cosine],
            y: [zero, b.cosine, zero - b.sine],
            shrunk: [a.shrunk, b.shrunk],
            bent: [a.shrunk * curvature.x, a.cosine * b.shrunk * curvature.y],
        }
    }
}

impl<S: Simd> Unrolled<S> {
    /// A direction along `x`, `y` and the normal, of its components along the sheet's axes.
    #[inline(always)]
    pub(super) fn along(&self, v: &Vectors<S>) -> Vectors<S> {
        [inner(v, &self.x), inner(v, &self.y), inner(v, &self.normal)]
    }

    /// The other way round.
    #[inline(always)]
    pub(super) fn back(&self, v: &Vectors<S>) -> Vectors<S> {
        let mut sum = *v;
        for (k, sum) in sum.iter_mut().enumerate() {
            let ends = v[1].mul_add(self.y[k], v[2] * self.normal[k]);
            *sum = v[0].mul_add(self.x[k], ends);
        }
        sum
    }
}

impl Sheet {
    /// A place relative to the origin, unrolled, and the height above it.
    #[inline(always)]
    pub(super) fn unrolled(&self, p: Vec3) -> (Vec2, f32) {
        let [x, y, z] = self.axes.map(|a| p.dot(a));
        let [lifted, b] = circle(y, z, self.curvature.y);
        let [height, a] = circle(x, lifted, self.curvature.x);
        (Vec2::new(a, b), height)
    }
}
