//! What the extent of samples makes of a border that they cross.
//!
//! With `x` the distance of the border's line from the foot, `h` the height, `n = x² + h²`, and `l`
//! along the line, a border adds `x L + |h| Λ / 2` and more to `2π` times the integral over a sheet,
//! where `L = ½ ∫ dl / R` has a pole on the line, and `Λ`, the angle at which it is seen from above,
//! makes a step there for places that are not high. Of a sample that is wider than its middle is far
//! from the line, the middle tells little. So where `n < w`, some part of the square of its side, `L`
//! takes `(w + n² / w) / 2` for `n`, and `Λ` takes `h² + (w - n)² / 2w` for `h²`. The differences are
//! those of a line without ends, of which a border has its share: what it gains is the sum over its
//! pieces. Since no value changes away from the line, all that a sample is pushed while it crosses is
//! what it was.

use fearless_simd::{f32x16, prelude::*};

use super::lanes::{coarse_angle, half_ln};
use super::sight::Sight;
use super::vectors::splat;

/// `w` in units of the square of half a sample's side: least errors of pairs in contact. More blurs
/// what crosses the border at an angle.
const SOFT: f32 = 0.8;

/// Two terms of what borders take, and what `2π` times the value gains by softening them.
pub(super) struct Soft<S: Simd> {
    /// What is added to the logarithm and to the angle.
    pub(super) terms: [f32x16<S>; 2],
    /// Slopes of the gain with the squared height, with the distance of the line, and with the way
    /// along it.
    pub(super) rise: f32x16<S>,
    pub(super) across: f32x16<S>,
    pub(super) along: f32x16<S>,
}

/// `w`, and the inverse of its root.
pub(super) struct Wide<S: Simd> {
    pub(super) square: f32x16<S>,
    scale: f32x16<S>,
}

impl<S: Simd> Wide<S> {
    /// Of samples, half the side of a square as large.
    #[inline(always)]
    pub(super) fn new(half: f32x16<S>) -> Self {
        let square = (half * half * SOFT).max(1e-12);
        Self {
            square,
            scale: splat(half.token(), 1.0) / square.sqrt(),
        }
    }
}

impl<S: Simd> Soft<S> {
    /// Those of a line that is seen so, between ends, as wide as samples are.
    #[inline(always)]
    pub(super) fn new(sight: &Sight<S>, ends: [f32x16<S>; 2], wide: &Wide<S>) -> Self {
        let simd = wide.square.token();
        let (scale, per_wide, wide) = (wide.scale, wide.scale * wide.scale, wide.square);
        let zero = splat(simd, 0.0);
        let (across, height) = (sight.across, sight.height);
        // Of every product of two of the lengths that are divided by, one quotient is enough.
        let near = sight.near.max(1e-15);
        let soft = (near * near * per_wide + wide) * 0.5;
        let both = splat(simd, 1.0) / (near * soft);
        let per_near = soft * both;
        let ratio = near * near * both;
        let logarithm = half_ln(ratio);
        let slope = (per_near - ratio * per_wide) * 0.5;
        // Of the angle.
        let left = (wide - near).max(zero);
        let square = left * left * 0.5 * per_wide + sight.square;
        let high = square.max(1e-15).sqrt();
        let rise = across.abs() * (high - height).max(zero);
        let half_angle = coarse_angle(rise, height.mul_add(high, sight.flat));
        let angle = (half_angle + half_angle).copysign(across);
        let less = left * per_wide * -1.0;
        let per_far = splat(simd, 1.0) / (high * (sight.flat + square).max(1e-15));
        let up = (less + 1.0) * height * per_far - per_near;
        let out = less * sight.flat * per_far - square * per_far + height * per_near;
        // What of that is between the ends, and only where the line is near.
        let [(a, da), (b, db)] = ends.map(
            #[inline(always)]
            |end| share(end * scale),
        );
        let counts = sight.near.simd_lt(wide);
        let fade = counts.select(b - a, zero);
        let along = counts.select((da - db) * scale, zero);
        let gain = across * logarithm + height * angle * 0.5;
        Self {
            terms: [logarithm * fade, angle * fade],
            rise: across * (up * 0.5 + slope) * fade,
            across: (sight.flat * slope * 2.0 + height * out) * fade,
            along: gain * along,
        }
    }
}

/// Rises smoothly from a half below zero at -1 to a half at 1, and its slope.
#[inline(always)]
fn share<S: Simd>(t: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
    let t = t.max(-1.0).min(1.0);
    let square = t * t;
    (t * (0.75 - square * 0.25), 0.75 - square * 0.75)
}
