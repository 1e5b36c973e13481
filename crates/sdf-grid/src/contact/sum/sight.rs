//! Elementary integrals along a border's line, for sixteen samples.

use fearless_simd::{f32x16, prelude::*};

use super::lanes::{coarse_angle, half_ln};

/// A border's line as it is seen from samples.
pub(super) struct Sight<S: Simd> {
    /// Above or below, and its square.
    pub(super) height: f32x16<S>,
    pub(super) square: f32x16<S>,
    /// Distance of the line from the feet, and its square.
    pub(super) across: f32x16<S>,
    pub(super) flat: f32x16<S>,
    /// Squared distance of the line.
    pub(super) near: f32x16<S>,
}

/// Of a part of the line: half of `∫ dl / R`, and the angles at which it is seen in the plane and
/// from above it, `across ∫ dl / (across² + l²)` and `across |h| ∫ dl / ((across² + l²) R)`.
pub(super) type Newtonian<S> = [f32x16<S>; 3];

impl<S: Simd> Sight<S> {
    /// From end to end, where the squared distances are as given.
    #[inline(always)]
    pub(super) fn piece(
        &self,
        [a, b]: [f32x16<S>; 2],
        [far_a, far_b]: [f32x16<S>; 2],
    ) -> Newtonian<S> {
        let (ra, rb) = (far_a.sqrt(), far_b.sqrt());
        let (pa, pb) = (ra + a.abs(), rb + b.abs());
        let product = a * b;
        let beside = product.simd_lt(0.0);
        // From the ends where nothing cancels.
        let above = beside.select(pa * pb, pa.max(pb)).max(1e-30);
        let below = beside.select(self.near, pa.min(pb)).max(1e-30);
        let wide = self.across.abs() * (b - a);
        let rise = self.height * self.across.abs() * b.mul_sub(ra, a * rb).max(0.0);
        self.newtonian(
            above / below,
            [wide, self.flat + product],
            [rise, self.flat.mul_add(ra * rb, self.square * product)],
        )
    }

    /// All of it in reach, so far to either side.
    #[inline(always)]
    pub(super) fn chord(&self, side: f32x16<S>) -> Newtonian<S> {
        let above = side + 1.0;
        let wide = self.across.abs() * (side + side);
        let square = side * side;
        self.newtonian(
            above * above / self.near.min(1.0).max(1e-30),
            [wide, self.flat - square],
            [self.height * wide, self.flat - self.square * square],
        )
    }

    /// Of the argument of a logarithm, and of sines and cosines of angles.
    #[inline(always)]
    fn newtonian(
        &self,
        ratio: f32x16<S>,
        angle: [f32x16<S>; 2],
        lifted: [f32x16<S>; 2],
    ) -> Newtonian<S> {
        [
            half_ln(ratio),
            coarse_angle(angle[0], angle[1]).copysign(self.across),
            coarse_angle(lifted[0], lifted[1]).copysign(self.across),
        ]
    }
}
