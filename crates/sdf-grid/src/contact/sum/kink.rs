//! What a sample's extent makes of the kernel's integral over a sheet that it crosses.
//!
//! The integral has a kink where the height `x` is zero: it is `S(x) - |x|/2` with `S` smooth. The
//! average of `|x|` over a piece of surface that reaches `e` to either side is `(x² + e²) / (2 e)`
//! where `|x| < e`, so that of `-|x|/2` is less than the middle's by `(e - |x|)² / (4 e)`, and that of
//! `S` is more by about `e² S'' / 6`. Over all heights both are the same, `e²/6`: samples that are
//! spread evenly tell no more or less than all of the surface, whatever their phase. A square of half
//! a side `r` that leans by an angle `θ` has `e = r sin θ`: exact where it leans about a side, and of
//! the same second moment elsewhere. Heights above a torus are not better known than facets keep to
//! it, which extends samples likewise.
//!
//! At the sheet's border, where the kink ends, both fade out.

use fearless_simd::{f32x16, prelude::*};

use super::border::{Above, Line};
use super::osculating::OFF;
use super::slopes::{Slopes, half_sign};
use super::smooth::curvature;
use super::vectors::splat;

/// Where it begins to fade, in units of `r`.
const FADE: f32 = 0.7;

/// Squared sine of the least angle that counts.
const LEAST: f32 = 1e-8;

/// How far facets stray from the torus that stands for them, in units of the reach: a half of what
/// is allowed.
pub(super) const STRAY: f32 = 0.5 * OFF as f32;

/// How samples lean.
pub(super) struct Lean<S: Simd> {
    /// Of the angle between them and the sheet.
    pub(super) cosine: f32x16<S>,
    /// Their normals along the sheet's two directions.
    pub(super) aside: [f32x16<S>; 2],
    /// How far the surface may be from the sheet, in units of the reach.
    pub(super) stray: f32,
}

/// Samples that lean, and how near they are to borders.
pub(super) struct Leaning<S: Simd> {
    sine_squared: f32x16<S>,
    /// Squared.
    stray: f32,
    /// Square of where fading begins.
    width: f32x16<S>,
    /// Squared distance of the nearest border so far, and the way from it along the sheet's two
    /// directions: the nearest alone counts, so that it is the same in however many pieces a border
    /// comes.
    nearest: f32x16<S>,
    way: [f32x16<S>; 2],
}

impl<S: Simd> Lean<S> {
    /// None if all samples lie along the sheet, which is flat, or are too far from it.
    #[inline(always)]
    pub(super) fn leaning(&self, above: &Above<S>) -> Option<Leaning<S>> {
        let simd = self.cosine.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let [x, y] = self.aside;
        let sine_squared = x.mul_add(x, y * y);
        let extent = sine_squared + splat(simd, self.stray);
        let counts = extent.simd_gt(splat(simd, LEAST)) & above.square.simd_lt(one);
        counts.any_true().then(|| {
            let width = above.half * FADE;
            let width = (width * width).max(1e-20);
            Leaning {
                sine_squared: counts.select(sine_squared, zero),
                stray: self.stray * self.stray,
                width,
                nearest: width,
                way: [zero; 2],
            }
        })
    }
}

impl<S: Simd> Leaning<S> {
    /// Looks whether a border so long is nearer than others.
    #[inline(always)]
    pub(super) fn pass(&mut self, line: &Line<S>, length: f32) {
        let zero = splat(self.nearest.token(), 0.0);
        let (across, start) = (line.across, line.start);
        let beyond = start.max(zero) + (start + length).min(zero);
        let square = across.mul_add(across, beyond * beyond);
        let nearer = square.simd_lt(self.nearest);
        if !nearer.any_true() {
            return;
        }
        self.nearest = square.min(self.nearest);
        let (out, along) = (line.outward, line.along);
        for k in 0..2 {
            let way = across.mul_add(out[k], beyond * along[k]);
            self.way[k] = nearer.select(way, self.way[k]);
        }
    }

    /// One away from borders and zero on them, and its slopes along the sheet.
    #[inline(always)]
    fn faded(&self) -> (f32x16<S>, [f32x16<S>; 2]) {
        let scale = splat(self.nearest.token(), 1.0) / self.width;
        let t = self.nearest * scale;
        // By the square of the distance, times two.
        let slope = (t - t * t) * scale * -12.0;
        (
            t * t * (3.0 - t * 2.0),
            [slope * self.way[0], slope * self.way[1]],
        )
    }

    /// Adds to the sums of samples, so many times above the sheet. What comes back is what the normal
    /// is to be multiplied with for the moment by the change of `θ`.
    #[inline(always)]
    pub(super) fn add_to(
        &self,
        above: &Above<S>,
        cosine: f32x16<S>,
        inside: f32x16<S>,
        sums: &mut Slopes<S>,
    ) -> f32x16<S> {
        let zero = splat(inside.token(), 0.0);
        let square = above.half * above.half;
        let leaning = self.sine_squared.simd_gt(zero);
        let share = leaning.select(square * inside, zero) * (1.0 / 6.0);
        let [second, third] = curvature(above.square);
        let mut value = share * self.sine_squared * second;
        let mut rise = share * self.sine_squared * third * above.height;
        let mut turning = share * second * -2.0;
        let extent = square.mul_add(self.sine_squared, self.stray).sqrt();
        let height = above.height.abs();
        let deep = (extent - height).max(zero);
        if deep.simd_gt(zero).any_true() {
            let inverse = splat(inside.token(), 1.0) / extent.max(1e-20);
            let (part, most) = (deep * inverse, inside * 0.25);
            value -= most * deep * part;
            rise = (most * part * 4.0).mul_add(half_sign(above.height), rise);
            // e² - x² over e², and r² / e.
            let bow = part * (extent + height) * inverse;
            turning += most * bow * square * inverse;
        }
        let (fade, slopes) = self.faded();
        sums.value = value.mul_add(fade, sums.value);
        sums.height = rise.mul_add(fade, sums.height);
        sums.along[0] = value.mul_add(slopes[0], sums.along[0]);
        sums.along[1] = value.mul_add(slopes[1], sums.along[1]);
        turning * fade * cosine * cosine
    }
}
