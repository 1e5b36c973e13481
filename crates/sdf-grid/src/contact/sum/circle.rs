//! Places above a circle.

use fearless_simd::{f32x16, prelude::*};

use super::vectors::splat;
use crate::support::angle::upper_angle;

/// Nearer to a circle's centre, in units of its radius, there is no direction.
const CENTRE: f32 = 1e-2;

/// Places above a circle through the origin, along `x` there, its centre below if it is bent by more
/// than zero.
pub(super) struct Circle<S: Simd> {
    pub(super) height: f32x16<S>,
    /// Of the foot, along the circle.
    pub(super) place: f32x16<S>,
    /// Cosine and sine of the angle by which the circle turns on the way there.
    pub(super) cosine: f32x16<S>,
    pub(super) sine: f32x16<S>,
    /// The circle's radius over the distance from its centre.
    pub(super) shrunk: f32x16<S>,
}

impl<S: Simd> Circle<S> {
    /// At `(x, z)` above a circle of curvature `k`.
    #[inline(always)]
    pub(super) fn new(x: f32x16<S>, z: f32x16<S>, k: f32) -> Self {
        let simd = x.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        if k == 0.0 {
            return Self {
                height: z,
                place: x,
                cosine: one,
                sine: zero,
                shrunk: one,
            };
        }
        let square = x.mul_add(x, z * z);
        let rise = square.mul_add(k, z + z);
        let distance = rise.mul_add(k, one).max(CENTRE * CENTRE).sqrt();
        let shrunk = one / distance;
        let (up, aside) = (z.mul_add(k, one), x * k);
        let angle = upper_angle(aside.abs(), up).copysign(aside);
        Self {
            height: rise / (distance + 1.0),
            place: angle * (1.0 / k),
            cosine: up * shrunk,
            sine: aside * shrunk,
            shrunk,
        }
    }
}

/// The height of one place above a circle of curvature `k` as in [`Circle`], and the place of its
/// foot.
#[inline(always)]
pub(super) fn circle(x: f32, z: f32, k: f32) -> [f32; 2] {
    let rise = 2.0 * z + k * (x * x + z * z);
    let distance = (1.0 + k * rise).max(0.0).sqrt();
    let place = match k == 0.0 {
        true => x,
        false => (k * x).atan2(1.0 + k * z) / k,
    };
    [rise / (1.0 + distance), place]
}
