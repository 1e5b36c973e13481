//! What a sheet adds to samples above it.

use fearless_simd::{f32x16, prelude::*};

use super::border::{Above, Taken};
use super::smooth::Quotients;
use super::vectors::splat;

/// Heights, in units of the reach, that single precision does not tell from zero, many times over:
/// some ten nanometres. Walls as near as that are flush.
const FLUSH: f32 = 1e-5;

/// Half the sign of a height; between those of both sides for walls that are flush, where it is zero:
/// the mean of the slopes to either side, whatever rounding makes of the height.
#[inline(always)]
pub(super) fn half_sign<S: Simd>(height: f32x16<S>) -> f32x16<S> {
    let half = splat(height.token(), 0.5);
    (height * (0.5 / FLUSH)).min(half).max(half * -1.0)
}

/// The integral of the kernel over a sheet, and its slopes with the height and along the sheet's two
/// directions.
pub(super) struct Slopes<S: Simd> {
    pub(super) value: f32x16<S>,
    pub(super) height: f32x16<S>,
    pub(super) along: [f32x16<S>; 2],
    /// What the normal is multiplied with for the moment, besides the value.
    pub(super) turning: f32x16<S>,
}

impl<S: Simd> Slopes<S> {
    /// So many times over the whole plane, without what borders take.
    #[inline(always)]
    pub(super) fn new(
        above: &Above<S>,
        kernel: &Quotients<S>,
        taken: &Taken<S>,
        inside: f32x16<S>,
    ) -> Self {
        const TURN: f32 = 1.0 / std::f32::consts::TAU;
        let zero = splat(inside.token(), 0.0);
        // What of the plane is seen from the foot and from above it.
        let seen = taken.angle.mul_add(-TURN, inside);
        let lifted = taken.lifted.mul_add(-TURN, inside);
        let sign = half_sign(above.height);
        let flat = kernel.value.mul_add(seen, taken.rest * TURN);
        let bent = kernel.slope.mul_add(seen, taken.tilt * -TURN);
        Self {
            value: flat - above.height * sign * lifted,
            height: (above.height + above.height).mul_sub(bent, sign * lifted),
            along: taken.along.map(|a| a * TURN),
            turning: zero,
        }
    }
}
