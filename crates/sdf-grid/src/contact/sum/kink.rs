//! What a sample's extent takes from the kink of the kernel on a sheet.
//!
//! The integral of the kernel over a sheet has a kink where the height `x` is zero: it holds
//! `-|x|/2`. The average of `|x|` over a piece of surface that reaches `e` to either side is
//! `(x² + e²) / (2 e)` where `|x| < e`, so the average is less than the middle by
//! `(e - |x|)² / (4 e)`. A square of half a side `r` that leans by an angle `θ` has `e = r sin θ`:
//! exact where it leans about a side, and of the same second moment elsewhere.
//!
//! At the sheet's border, where the kink ends, this fades out.

use fearless_simd::{f32x16, prelude::*};
use glam::{Vec2, Vec3};

use super::border::{Above, Seen};
use super::sheet::Border;
use super::slopes::{Slopes, half_sign};
use super::vectors::{Vectors, dot, splat};

/// Where it begins to fade, in units of `r`.
const FADE: f32 = 0.7;

/// Squared sine of the least angle that counts.
const LEAST: f32 = 1e-8;

/// More than what squares of unit vectors in single precision are off.
const ROUNDING: f32 = 2e-6;

/// How samples lean.
pub(super) struct Lean<'a, S: Simd> {
    /// Of the angle between them and the sheet.
    pub(super) cosine: f32x16<S>,
    pub(super) aside: Aside<'a, S>,
}

/// The samples' normals along the sheet's two directions, which few samples ask for.
pub(super) enum Aside<'a, S: Simd> {
    Known([f32x16<S>; 2]),
    /// Those of normals along these.
    Of(&'a Vectors<S>, [Vec3; 2]),
}

impl<S: Simd> Aside<'_, S> {
    #[inline(always)]
    fn get(&self) -> [f32x16<S>; 2] {
        match self {
            Self::Known(aside) => *aside,
            Self::Of(normals, axes) => [dot(normals, axes[0]), dot(normals, axes[1])],
        }
    }
}

impl<S: Simd> Lean<'_, S> {
    /// Adds to the sums of samples, so many times above the sheet, none if all are too far. What
    /// comes back is what the normal is to be multiplied with for the moment by the change of `θ`.
    #[inline(always)]
    pub(super) fn add_to(
        &self,
        above: &Above<S>,
        borders: &[Border],
        foot: Vec2,
        inside: f32x16<S>,
        sums: &mut Slopes<S>,
    ) -> f32x16<S> {
        let simd = inside.token();
        let zero = splat(simd, 0.0);
        // A bound of what follows: rounding leaves less than that between the squares' sum and one.
        let most = above.half * above.half * (1.0 + ROUNDING - self.cosine * self.cosine);
        if !most.simd_gt(above.square).any_true() {
            return zero;
        }
        let [x, y] = self.aside.get();
        let sine_squared = x.mul_add(x, y * y);
        let counts = sine_squared.simd_gt(splat(simd, LEAST));
        let extent = above.half * counts.select(sine_squared, zero).sqrt();
        let height = above.height.abs();
        let deep = (extent - height).max(zero);
        if !deep.simd_gt(zero).any_true() {
            return zero;
        }
        let inverse = splat(simd, 1.0) / extent.max(1e-20);
        let width = above.half * FADE;
        let (fade, slopes) = faded(above, borders, foot, width);
        let (part, most) = (deep * inverse, inside * 0.25);
        let value = most * deep * part;
        sums.value -= value * fade;
        let rise = most * part * fade * 4.0;
        sums.height = rise.mul_add(half_sign(above.height), sums.height);
        sums.along[0] -= value * slopes[0];
        sums.along[1] -= value * slopes[1];
        // e² - x² over e², and r² / e.
        let bow = part * (extent + height) * inverse;
        let lever = above.half * above.half * inverse;
        most * fade * bow * lever * self.cosine * self.cosine
    }
}

/// One away from borders and zero on them, and its slopes.
#[inline(always)]
fn faded<S: Simd>(
    above: &Above<S>,
    borders: &[Border],
    foot: Vec2,
    width: f32x16<S>,
) -> (f32x16<S>, [f32x16<S>; 2]) {
    let simd = width.token();
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    let (mut fade, mut slopes) = (one, [zero; 2]);
    let scale = one / (width * width).max(1e-20);
    for border in borders {
        let seen = Seen::new(border, foot);
        let line = seen.line(above);
        let (across, start) = (line.across, line.start);
        let beyond = start.max(zero) + (start + border.length).min(zero);
        let t = ((across * across + beyond * beyond) * scale).min(one);
        if !t.simd_lt(one).any_true() {
            continue;
        }
        let factor = t * t * (3.0 - t * 2.0);
        // By the square of the distance, times two, times the fade so far.
        let slope = (t - t * t) * scale * fade * -12.0;
        let (out, along) = (line.outward, line.along);
        let x = across.mul_add(out[0], beyond * along[0]);
        let y = across.mul_add(out[1], beyond * along[1]);
        slopes = [
            slopes[0].mul_add(factor, slope * x),
            slopes[1].mul_add(factor, slope * y),
        ];
        fade *= factor;
    }
    (fade, slopes)
}
