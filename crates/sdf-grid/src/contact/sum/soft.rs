//! What the extent of samples makes of a border that they cross.
//!
//! With `x` the distance of the border's line from the foot, `h` the height, `n = x² + h²`, and `l`
//! along the line, a border takes from the integral over a sheet, times `2π`, `x L` and `-|h| Λ / 2`,
//! where `L = ½ ∫ dl / R` has a pole on the line, and `Λ`, the angle at which it is seen from above,
//! makes a step there for places that are not high. Of a sample that is as wide as it is high above
//! the line, or wider, the middle tells little. So where `n < w`, some part of the square of its
//! side, `L` takes `(w + n² / w) / 2` for `n`, and `Λ` takes `h² + (w - n)² / 2w` for `h²`. Where a
//! corner ends the line both stay continuous, and since neither value changes away from the line, all
//! that a sample is pushed while it crosses is what it was.

use fearless_simd::{f32x16, prelude::*};

use super::border::Sight;
use super::lanes::{coarse_angle, half_ln};
use super::vectors::splat;

/// `w` in units of the square of half a sample's side: least errors of pairs in contact. More blurs
/// what crosses the border at an angle.
pub(super) const SOFT: f32 = 0.8;

/// What borders take, as [`super::border::Taken`] adds it up.
pub(super) struct Soft<S: Simd> {
    /// The logarithm and the angle.
    pub(super) terms: [f32x16<S>; 2],
    /// What `2π` times the value gains besides: its slopes with the squared height, with the distance
    /// of the line, and with the way along it.
    pub(super) rise: f32x16<S>,
    pub(super) across: f32x16<S>,
    pub(super) along: f32x16<S>,
}

/// A line from end to end, as it is seen from a height.
struct Seen<S: Simd> {
    /// Squared distance of the line, and what is one over it.
    near: f32x16<S>,
    per_near: f32x16<S>,
    /// Distances of both ends, and what is one over them.
    far: [f32x16<S>; 2],
    inverse: [f32x16<S>; 2],
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    fn new(flat: f32x16<S>, square: f32x16<S>, ends: [f32x16<S>; 2]) -> Self {
        let one = splat(flat.token(), 1.0);
        let near = (flat + square).max(1e-30);
        let far = ends.map(|end| end.mul_add(end, near).sqrt());
        Self {
            near,
            per_near: one / near,
            far,
            inverse: far.map(|r| one / r),
        }
    }

    /// `[l / R]` between the ends.
    #[inline(always)]
    fn between(&self, [a, b]: [f32x16<S>; 2]) -> f32x16<S> {
        b * self.inverse[1] - a * self.inverse[0]
    }
}

impl<S: Simd> Soft<S> {
    /// Those of a line that goes on to either side as far as the kernel reaches, of which what is near
    /// differs from a line without ends by the square of `w`.
    #[inline(always)]
    pub(super) fn endless(sight: &Sight<S>, wide: f32x16<S>, terms: [f32x16<S>; 2]) -> Self {
        let simd = wide.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let (across, height) = (sight.across, sight.height);
        let near = sight.near.max(1e-30);
        let (per_wide, per_near) = (one / wide, one / near);
        let soft = (near * near * per_wide + wide) * 0.5;
        let slope = (per_near - near * per_wide / soft) * 0.5;
        // Of the angle.
        let left = (wide - near).max(zero);
        let square = left * left * 0.5 * per_wide + sight.square;
        let high = square.max(1e-30).sqrt();
        let apart = across.abs();
        let more = coarse_angle(
            apart * (high - height).max(zero),
            height.mul_add(high, sight.flat),
        );
        let less = left * per_wide * -1.0;
        let (per_high, per_soft) = (one / high, one / (sight.flat + square).max(1e-30));
        let up = (less + 1.0) * height * per_high * per_soft - per_near;
        let out = less * sight.flat * per_high * per_soft - high * per_soft + height * per_near;
        let counts = sight.near.simd_lt(wide);
        Self {
            terms: [
                counts.select(half_ln(near / soft) + terms[0], terms[0]),
                counts.select((more + more).copysign(across) + terms[1], terms[1]),
            ],
            rise: counts.select(across * (up * 0.5 + slope), zero),
            across: counts.select((sight.flat * slope) * 2.0 + height * out, zero),
            along: zero,
        }
    }

    /// Those of a line that is seen so, between ends, where the logarithm and the angle are as given.
    #[inline(always)]
    pub(super) fn new(
        sight: &Sight<S>,
        ends: [f32x16<S>; 2],
        wide: f32x16<S>,
        terms: [f32x16<S>; 2],
    ) -> Self {
        let zero = splat(wide.token(), 0.0);
        let seen = Seen::new(sight.flat, sight.square, ends);
        let pole = Self::pole(sight, &seen, ends, wide);
        let step = Self::step(sight, &seen, ends, wide);
        let counts = sight.near.simd_lt(wide) & ends[1].simd_gt(ends[0]);
        Self {
            terms: [0, 1].map(
                #[inline(always)]
                |k| counts.select([pole.terms[0], step.terms[1]][k], terms[k]),
            ),
            rise: counts.select(sight.across * pole.rise + step.rise, zero),
            across: counts.select(pole.across + step.across, zero),
            along: counts.select(sight.across * pole.along + step.along, zero),
        }
    }

    /// Of the logarithm: `rise` and `along` are its own, not those of the value.
    #[inline(always)]
    fn pole(sight: &Sight<S>, seen: &Seen<S>, [a, b]: [f32x16<S>; 2], wide: f32x16<S>) -> Self {
        let zero = splat(wide.token(), 0.0);
        let near = (seen.near * seen.near / wide + wide) * 0.5;
        let soft = Seen::new(near, zero, [a, b]);
        let (pa, pb) = (soft.far[0] + a.abs(), soft.far[1] + b.abs());
        let beside = (a * b).simd_lt(0.0);
        let above = beside.select(pa * pb, pa.max(pb));
        let below = beside.select(near, pa.min(pb)).max(1e-30);
        let before = seen.between([a, b]) * seen.per_near;
        let after = soft.between([a, b]) * seen.near * soft.per_near / wide;
        let slope = (before - after) * 0.25;
        let along = seen.inverse[1] - seen.inverse[0] - soft.inverse[1] + soft.inverse[0];
        Self {
            terms: [half_ln(above / below), zero],
            rise: slope,
            across: sight.flat * slope * 2.0,
            along: along * 0.5,
        }
    }

    /// Of the angle.
    #[inline(always)]
    fn step(sight: &Sight<S>, seen: &Seen<S>, [a, b]: [f32x16<S>; 2], wide: f32x16<S>) -> Self {
        let simd = wide.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let left = (wide - seen.near).max(zero);
        let per_wide = one / wide;
        let square = left * left * 0.5 * per_wide + sight.square;
        let soft = Seen::new(sight.flat, square, [a, b]);
        let high = square.max(1e-30).sqrt();
        let apart = sight.across.abs();
        let [ra, rb] = soft.far;
        let rise = high * apart * b.mul_sub(ra, a * rb).max(0.0);
        let angle = coarse_angle(rise, sight.flat.mul_add(ra * rb, square * (a * b)));
        // With the height, with the distance, and along the line.
        let with_height = |s: &Seen<S>| sight.across * s.between([a, b]) * s.per_near;
        let [per_a, per_b] = [a, b].map(|end| one / end.mul_add(end, sight.flat).max(1e-20));
        let with_distance = |s: &Seen<S>, high: f32x16<S>| {
            let [ra, rb] = s.far;
            let of_a = a * ra.mul_add(ra, sight.flat) * s.inverse[0] * per_a;
            let of_b = b * rb.mul_add(rb, sight.flat) * s.inverse[1] * per_b;
            (of_a - of_b) * high * s.per_near
        };
        let with_place = |s: &Seen<S>, high: f32x16<S>| {
            (s.inverse[1] * per_b - s.inverse[0] * per_a) * high * sight.across
        };
        // Of the soft height, over the true one and over the distance.
        let per_high = one / high;
        let less = left * per_wide * -1.0;
        let [up, out] = [one + less, less].map(|d| d * per_high);
        let soft_height = with_height(&soft);
        let up = up * sight.height * soft_height - with_height(seen);
        let out = out * sight.across * soft_height + with_distance(&soft, high)
            - with_distance(seen, sight.height);
        let place = with_place(seen, sight.height) - with_place(&soft, high);
        let half = sight.height * 0.5;
        Self {
            terms: [zero, angle.copysign(sight.across)],
            // Of `|h| / 2` times the angle, by `h²`.
            rise: up * 0.25,
            across: half * out,
            along: half * place,
        }
    }
}
